"""Settings of a live CAN bus."""

from dataclasses import dataclass

DEFAULT_INTERFACE = 'socketcan'
DEFAULT_CHANNEL = 'can0'
DEFAULT_BITRATE = 1_000_000  #: Bit rate used if the user sets none [bit/s].
DEFAULT_NODE_ID = 32  #: node-ID used if the user sets none
DEFAULT_LAYOUT = 'sim16x16.yaml'  #: skin layout used if the user sets none: that of the simulated pad


@dataclass(frozen=True)
class BusSettings:
    """Settings for opening a bus, configuring its devices and reading its pads."""

    interface: str  #: interface name of python-can
    channel: str  #: channel of the interface
    bitrate: int = DEFAULT_BITRATE  #: bit rate [bit/s]
    sync_period: float = 0.02  #: time between two SYNCs, and between two polls of a DOMAIN [s]
    produce_sync: bool = True  #: False if another device sends SYNC
    boot_timeout: float = 5.0  #: time allowed for the first answer of each device [s]
    sdo_timeout: float = 0.3  #: time allowed for each SDO answer [s]
    sdo_retries: int = 3  #: number of times an unanswered SDO request is repeated
    heartbeat_ms: int = 100  #: heartbeat time written to object 0x1017 of each device [ms]
    allow_full_bus: bool = False  #: True to accept a planned load above `load.FULL_LOAD`
    queue_limit: int = 20_000  #: largest number of CAN frames that may wait for the assembler
    drop_incomplete: bool = False  #: True to withhold and count sweeps that lack TPDOs; False to emit them with NaN
    record: str = ''  #: log file for all frames on the bus, including those sent by this driver; '' for no recording
    record_largest: int = 0  #: file size at which the recording continues in a new file [bytes]; 0 for a single file
