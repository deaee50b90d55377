"""Indices of the objects in the communication profile area (CiA 301, 7.5.2)."""

DEVICE_TYPE = 0x1000
ERROR_REGISTER = 0x1001
ERROR_FIELD = 0x1003  #: sub 0 number of errors, sub 1 the newest
COB_ID_SYNC = 0x1005
DEVICE_NAME = 0x1008
HARDWARE_VERSION = 0x1009
SOFTWARE_VERSION = 0x100A
STORE_PARAMETERS = 0x1010  #: sub 1 all, 2 communication, 3 application
RESTORE_PARAMETERS = 0x1011  #: the same
PRODUCER_HEARTBEAT_TIME = 0x1017
IDENTITY = 0x1018  #: sub 1 vendor, 2 product, 3 revision, 4 serial number
TPDO_COMMUNICATION = 0x1800  #: of TPDO 1; sub 1 COB-ID, 2 transmission type
TPDO_MAPPING = 0x1A00  #: of TPDO 1; sub 0 number of mapped objects, then index, sub-index and bits of each

MAX_INDEX = 0xFFFF
MAX_SUBINDEX = 0xFE
