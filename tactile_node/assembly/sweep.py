"""The TPDOs of one pad that answer one SYNC."""

from dataclasses import dataclass, field


@dataclass
class Sweep:
    """The TPDOs of one pad that answer one SYNC, while they are being received."""

    sequence: int  #: sequence number of the SYNC
    stamp: float  #: stamp of the SYNC [s]
    missing: int  #: number of TPDOs not received yet; a TPDO of the wrong length counts as received

    #: True if no TPDO is used, because the TPDOs may answer another SYNC or the stamp may be wrong
    is_discarded: bool = False
    is_emitted: bool = False  #: True if the taxel frame was emitted or withheld
    tpdos: dict[int, bytes] = field(default_factory=dict)  #: data of each valid TPDO by rank

    @property
    def is_closed(self) -> bool:
        """True if the sweep takes no further TPDOs."""
        return self.is_discarded or self.is_emitted

    def discard(self) -> int:
        """Discard all TPDOs of the sweep, and return their number."""
        lost = len(self.tpdos)
        self.tpdos = {}
        self.is_discarded = True
        return lost
