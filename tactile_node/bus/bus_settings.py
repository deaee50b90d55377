"""How a bus is reached and run."""

from dataclasses import dataclass

DEFAULT_INTERFACE = 'socketcan'
DEFAULT_CHANNEL = 'can0'
DEFAULT_BITRATE = 1_000_000  #: [bit/s]


@dataclass(frozen=True)
class BusSettings:
    """How to reach the bus, and how its pads are read."""

    interface: str
    channel: str
    bitrate: int = DEFAULT_BITRATE
    sync_period: float = 0.02  #: [s]
    produce_sync: bool = True  #: False: another device sends SYNC
    boot_timeout: float = 5.0  #: how long each device may take to answer [s]
    sdo_timeout: float = 0.3  #: how long each answer by SDO may take [s]
    sdo_retries: int = 3  #: further requests where there is no answer
    heartbeat_ms: int = 100  #: written to each device's 0x1017
    allow_full_bus: bool = False  #: even where pads and ``sync_period`` keep it busy for more than FULL_LOAD
    queue_limit: int = 20_000  #: CAN frames that may wait for the worker
    drop_incomplete: bool = False  #: withhold and count a sweep that lacks TPDOs; else it is given with NaN
    record: str = ''  #: log file for everything on the bus, own frames included
    record_largest: int = 0  #: bytes from which on the recording's next file begins; 0: one file
