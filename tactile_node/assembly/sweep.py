"""The TPDOs of one pad that answer one SYNC."""

import numpy as np

from tactile_node.cia301.objects import MAX_PDO_BYTES


class Sweep:
    """The TPDOs of one pad that answer one SYNC.

    Parameters
    ----------
    sequence : int
        Sequence number of the SYNC.
    stamp : float
        Stamp of the SYNC [s].
    tpdos : int
        Number of TPDOs of the pad.

    Attributes
    ----------
    missing : int
        Number of TPDOs that were not received yet. A TPDO of the wrong length counts as received.
    is_discarded : bool
        True if the TPDOs are lost, because they may answer another SYNC or the stamp may be wrong.
    is_emitted : bool
        True if the taxel frame was emitted or withheld.
    """

    def __init__(self, sequence: int, stamp: float, tpdos: int):
        self.sequence = sequence
        self.stamp = stamp
        self.words = bytearray(MAX_PDO_BYTES * tpdos)
        self._fresh = bytearray(tpdos)
        self.missing = tpdos
        self.is_discarded = False
        self.is_emitted = False

    @property
    def fresh(self) -> np.ndarray:
        """True for each TPDO that the sweep contains, by rank."""
        return np.frombuffer(self._fresh, bool)

    @property
    def used(self) -> int:
        """Number of TPDOs that the sweep contains."""
        return sum(self._fresh)

    @property
    def is_closed(self) -> bool:
        """True if the sweep takes no further TPDOs."""
        return self.is_discarded or self.is_emitted

    def add(self, rank: int, data: bytes) -> None:
        """Add the data of a TPDO."""
        self.words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * rank + len(data)] = data
        self._fresh[rank] = True

    def discard(self) -> int:
        """Discard all TPDOs of the sweep, and return their number."""
        lost = self.used
        self._fresh = bytearray(len(self._fresh))
        self.is_discarded = True
        return lost
