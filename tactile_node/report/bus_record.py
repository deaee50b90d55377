"""What the CAN frames of a log say of the bus: load, gaps, NMT commands."""

from collections.abc import Mapping
from functools import lru_cache

import can
import numpy as np

from tactile_node.cia301.connection_set import NMT
from tactile_node.cia301.frame_bits import Frame, worst_case_bits
from tactile_node.read_only import read_only
from tactile_node.report.kept_entries import Ends, LongestGaps
from tactile_node.report.model import BusFacts, BusLoad, SeenCommand

WINDOW = 1.0  #: s, as of the driver's bus load
GAP = 0.5     #: s without any CAN frame; a skin at work sends every 20 ms
NMT_BYTES = 2
MOST_CHANNELS = 8  #: named


class BusRecord:
    """Takes every CAN frame of a log in turn. ``bit_rate`` [bit/s]; None: not known, no log has it."""

    def __init__(self, bit_rate: int | None):
        self._bit_rate = bit_rate
        self._bits: dict[int, int] = {}  # by window since the first CAN frame
        self._gaps = LongestGaps(GAP)
        self._channels: set[str] = set()  # of frames received: what was sent may have the name of no bus
        self._commands: Ends[SeenCommand] = Ends()
        self.begin: float | None = None  #: first stamp
        self.end = 0.0

    def feed(self, message: can.Message) -> None:
        stamp = message.timestamp
        if self.begin is None:
            self.begin = stamp
        self.end = max(self.end, stamp)
        self._gaps.feed(stamp)
        if message.is_rx and len(self._channels) < MOST_CHANNELS:
            self._channels.add(str(message.channel or ''))
        if message.is_error_frame:
            return
        window = int((stamp - self.begin) // WINDOW)
        self._bits[window] = self._bits.get(window, 0) + _bits(message.dlc, message.is_extended_id,
                                                              message.is_remote_frame)
        if message.arbitration_id == NMT and not message.is_extended_id and len(message.data) == NMT_BYTES:
            self._commands.add(SeenCommand(stamp, message.data[0], message.data[1]))

    def facts(self, can_frames: Mapping[str, int]) -> BusFacts:
        return BusFacts(can_frames=dict(can_frames), load=self._load(), gaps=self._gaps.gaps(),
                        gap_count=self._gaps.count, commands=self._commands.kept(),
                        command_count=self._commands.count, reported=None, channels=tuple(sorted(self._channels)))

    def _load(self) -> BusLoad | None:
        """Without the last window, which the log may not fill; None where it fills none."""
        if self.begin is None or self.end - self.begin < WINDOW:
            return None
        windows = int((self.end - self.begin) // WINDOW)
        used = {window: bits for window, bits in self._bits.items() if window < windows}
        # of a time without CAN frames only the ends: a clock that was set forward makes years of it
        edges = {window + step for window in used for step in (-1, 1)} | {0, windows - 1}
        places = sorted(window for window in edges | set(used) if 0 <= window < windows)
        rates = np.array([used.get(window, 0) for window in places]) / WINDOW
        mean = sum(used.values()) / (windows * WINDOW)
        shares = None if self._bit_rate is None else read_only(rates / self._bit_rate)
        return BusLoad(WINDOW, read_only(self.begin + np.array(places) * WINDOW), read_only(rates), shares,
                       mean if self._bit_rate is None else mean / self._bit_rate)


@lru_cache(maxsize=256)
def _bits(length: int, is_extended: bool, is_remote: bool) -> int:
    data = b'' if is_remote else bytes(min(length, 8))
    return worst_case_bits(Frame(0, data, is_extended, is_remote))
