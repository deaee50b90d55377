"""Facts of CiA 301 (CANopen): COB-IDs, heartbeat, EMCY, SDO upload. Pure: no bus, no thread of its own."""
