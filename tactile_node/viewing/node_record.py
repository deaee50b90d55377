"""What the CAN frames of a log say of its nodes: identity, NMT states, heartbeats, EMCYs (CiA 301).

COB-IDs are those of the predefined connection set, which devices rarely change.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from functools import lru_cache

import can
import numpy as np

from tactile_node.cia301.emergency import Emergency, decode_emergency
from tactile_node.cia301.frame_bits import Frame, worst_case_bits
from tactile_node.cia301.heartbeat import TOGGLE
from tactile_node.cia301.objects import (
    DEVICE_NAME,
    DEVICE_TYPE,
    EMCY,
    HARDWARE_VERSION,
    HEARTBEAT,
    IDENTITY,
    NMT,
    PRODUCER_HEARTBEAT_TIME,
    SDO_REQUEST,
    SDO_RESPONSE,
    SOFTWARE_VERSION,
    NmtState,
    node_of,
)
from tactile_node.cia301.sdo import SdoUpload, Step
from tactile_node.read_only import read_only
from tactile_node.shape.methods import VisibilityGuard
from tactile_node.taxel_frame import TaxelFrame
from tactile_node.viewing.model import BusFacts, BusLoad, Ends, LongestGaps, NmtChange, NodeFacts, PadFacts, SeenCommand
from tactile_node.viewing.status_record import TaxelRecord
from tactile_node.viewing.touch_finder import MAX_PAUSE, TouchFinder

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


PERIODS = 5000  #: last periods of which the median is taken


class PadRecord:
    """Takes the frames of one pad; those of another shape (rows, cols) are counted in ``misshapen``."""

    def __init__(self, name: str, rows: int, cols: int, pitch: float, unit: str, recogniser: VisibilityGuard):
        self._name, self._shape, self._pitch, self._unit = name, (rows, cols), pitch, unit
        self._touches = TouchFinder(recogniser, pitch, unit)
        self._taxels = TaxelRecord(rows, cols, unit)
        self._gaps = LongestGaps(MAX_PAUSE)
        self._periods: deque[float] = deque(maxlen=PERIODS)
        self._last: TaxelFrame | None = None
        self._frames = self._incomplete = self._lost = 0
        self.misshapen = 0

    def feed(self, frame: TaxelFrame) -> None:
        if frame.values.shape != self._shape:
            self.misshapen += 1
            return
        if self._last is not None:
            self._periods.append(frame.stamp - self._last.stamp)
            self._lost += max(0, frame.sequence - self._last.sequence - 1)  # a driver that starts again counts from 0
        self._last = frame
        self._frames += 1
        self._incomplete += frame.missing_can_frames > 0
        self._gaps.feed(frame.stamp)
        self._taxels.feed(frame)
        self._touches.feed(frame)

    def facts(self) -> PadFacts:
        """The recording has ended."""
        self._touches.end()
        found = self._touches.found
        return PadFacts(
            name=self._name, rows=self._shape[0], cols=self._shape[1], pitch=self._pitch, unit=self._unit,
            frames=self._frames, incomplete=self._incomplete, lost_frames=self._lost,
            period=float(np.median(self._periods)) if self._periods else None, gaps=self._gaps.gaps(),
            gap_count=self._gaps.count, touches=found.touches(),
            touches_left_out=found.left_out, small_frames=found.small_frames,
            samples=tuple(self._touches.samples), health=self._taxels.health() if self._frames else None)


#: (index, sub-index) of what a ticket needs to name a device
OBJECTS = ((DEVICE_TYPE, 0), (DEVICE_NAME, 0), (HARDWARE_VERSION, 0), (SOFTWARE_VERSION, 0), (IDENTITY, 1),
           (IDENTITY, 2), (IDENTITY, 3), (IDENTITY, 4), (PRODUCER_HEARTBEAT_TIME, 0))
MOST_VALUES = 4  #: of one object: another one each time comes from a damaged log


class NodeRecords:
    """Takes every CAN frame of a log in turn. ``taken``: COB-IDs of TPDOs and SYNC, which are no EMCY."""

    def __init__(self, pads: Sequence[tuple[str, Sequence[int]]], taken: frozenset[int]):
        self._pads = {node_id: name for name, node_ids in pads for node_id in node_ids}
        self._taken = taken
        self._nodes: dict[int, _Node] = {}

    def feed(self, message: can.Message) -> None:
        can_id = message.arbitration_id
        if can_id in self._taken or message.is_extended_id or message.is_error_frame or message.is_remote_frame:
            return
        for base in (HEARTBEAT, EMCY, SDO_RESPONSE, SDO_REQUEST):
            node_id = node_of(can_id, base)
            if node_id is not None and (base != SDO_REQUEST or node_id in self._nodes or node_id in self._pads):
                self._node(node_id).feed(base, bytes(message.data), message.timestamp)

    def facts(self) -> tuple[NodeFacts, ...]:
        """Return the facts of all nodes that were heard, and of those of the pads, by node-ID."""
        for node_id in self._pads:
            self._node(node_id)
        return tuple(node.facts(node_id, self._pads.get(node_id)) for node_id, node in sorted(self._nodes.items()))

    def _node(self, node_id: int) -> '_Node':
        if node_id not in self._nodes:
            self._nodes[node_id] = _Node()
        return self._nodes[node_id]


class _Node:
    def __init__(self) -> None:
        self._uploads = {key: SdoUpload(*key) for key in OBJECTS}
        self._objects: dict[tuple[int, int], list[bytes]] = {}
        self._emergencies: Ends[Emergency] = Ends()
        self._nmt: Ends[NmtChange] = Ends()
        self._state: int | None = None
        self._heartbeats = 0
        self._last: float | None = None  # heartbeat
        self._longest: float | None = None

    def feed(self, base: int, data: bytes, stamp: float) -> None:
        if base == HEARTBEAT:
            self._heartbeat(data, stamp)
        elif base == EMCY:
            self._emergencies.add(decode_emergency(data, stamp))
        else:
            self._transfer(base == SDO_REQUEST, data)

    def facts(self, node_id: int, pad: str | None) -> NodeFacts:
        return NodeFacts(
            node_id=node_id, pad=pad, objects={key: tuple(values) for key, values in self._objects.items()},
            emergencies=self._emergencies.kept(), emergency_count=self._emergencies.count, nmt=self._nmt.kept(),
            nmt_count=self._nmt.count, heartbeats=self._heartbeats, longest_pause=self._longest)

    def _heartbeat(self, data: bytes, stamp: float) -> None:
        if not data:
            return
        state = data[0] & ~TOGGLE
        if state == NmtState.BOOT_UP or state != self._state:
            self._nmt.add(NmtChange(stamp, state))
        if state == NmtState.BOOT_UP:
            self._last = None
        else:
            self._heartbeats += 1
            if self._last is not None:
                self._longest = max(self._longest or 0.0, stamp - self._last)
            self._last = stamp
        self._state = state

    def _transfer(self, is_request: bool, data: bytes) -> None:
        for key, upload in self._uploads.items():
            step = upload.request(data) if is_request else upload.response(data)
            if step is Step.DONE:
                values = self._objects.setdefault(key, [])
                if upload.data not in values and len(values) < MOST_VALUES:
                    values.append(upload.data)
