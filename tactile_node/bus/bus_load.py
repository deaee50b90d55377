"""Estimates how much of a bus's time is in use."""

WINDOW = 1.0  # s


class BusLoad:
    """Bits per second against the bit rate, over windows of one second.

    The bits of each frame are its most, with bit stuffing at its worst, so real load is up to a fifth lower.
    """

    def __init__(self, bitrate: int):
        self._bitrate = bitrate
        self._begun: float | None = None
        self._bits = 0
        self.load = 0.0  #: 0..1, of the last whole window

    def update(self, now: float, bits: int) -> None:
        """``bits`` seen since the beginning, at ``now`` [s]."""
        if self._begun is not None:
            if now - self._begun < WINDOW:
                return
            self.load = (bits - self._bits) / self._bitrate / (now - self._begun)
        self._begun = now
        self._bits = bits
