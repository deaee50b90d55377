"""Facts of CiA 404 (device profile for measuring devices and closed-loop controllers)."""

AUTO_ZERO = 0x6125  #: "AI autozero", one sub-index a channel, write only
ZERO_SIGNATURE = b'zero'  #: to be written to AUTO_ZERO: 0x6F72657A, least significant byte first
