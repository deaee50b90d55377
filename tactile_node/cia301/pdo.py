"""Process data objects (CiA 301, 7.2.2 and 7.5.2.36 on)."""

MAX_TPDOS = 512  #: of one node
MAX_PDO_BYTES = 8  #: of a classic CAN frame
MAX_PDO_BITS = 8 * MAX_PDO_BYTES

# Transmission types, a sub-index of the communication record
TRANSMISSION_TYPE = 2
EVERY_SYNC = 1  #: synchronous; 2..240: at every 2nd..240th SYNC
MAX_SYNCHRONOUS = 240
MANUFACTURER_EVENT = 254  #: at an event that the maker defines; CiA 301 prescribes 254 or 255 for an MPDO
PROFILE_EVENT = 255  #: at an event that the device profile defines

# Times in the communication record (CiA 301, 7.5.2.37)
INHIBIT_TIME, INHIBIT_UNIT = 3, 1e-4  #: sub-index and unit [s]: least time between two transmissions of one TPDO
EVENT_TIMER, EVENT_TIMER_UNIT = 5, 1e-3  #: the same of the most time; 0: off
MAX_TIME = 0xFFFF  #: of both, in their units

# Multiplexed PDO in source addressing mode: node-ID, index and sub-index of one object, and its value
SAM_MPDO = 0xFE  #: in place of the number of mapped objects, sub 0 of the mapping record
MPDO_DATA_BITS = 32
