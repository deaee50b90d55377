"""Collect facts about nodes from the CAN frames of a log: identity, NMT states, heartbeats and EMCYs (CiA 301).

The functions assume the COB-IDs of the predefined connection set, which devices rarely change.
"""

from collections import Counter
from collections.abc import Mapping

import can
import numpy as np

from tactile_node.assembly.health import ForeignCommand
from tactile_node.cia301.emergency import decode_emergency
from tactile_node.cia301.frame_bits import load_bits
from tactile_node.cia301.heartbeat import nmt_state
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
from tactile_node.cia301.sdo import SdoUpload, UploadStep
from tactile_node.taxel_frame import read_only
from tactile_node.viewing.model import BusReport, Ends, LoadCurve, LongestGaps, NodeReport, ReportedEvent

LOAD_WINDOW = 1.0  #: averaging window of the bus load, as in the driver [s]
BUS_GAP = 0.5      #: shortest reported gap without any CAN frame [s]; a working skin sends CAN frames every 20 ms
NMT_BYTES = 2      #: length of an NMT command [bytes]
MOST_CHANNELS = 8  #: maximum number of channels listed


class BusRecord:
    """Collects facts about the bus from the CAN frames of a log, one frame at a time.

    Parameters
    ----------
    bit_rate
        Bit rate of the bus [bit/s], or None if unknown. A log does not contain the bit rate.
    """

    def __init__(self, bit_rate: int | None):
        self._bit_rate = bit_rate
        self._bits: Counter[int] = Counter()  # bits in each window, counted from the first CAN frame
        self._gaps = LongestGaps(BUS_GAP)
        # Only received frames count, because sent frames may lack the name of the bus.
        self._channels: set[str] = set()
        self._commands: Ends[ReportedEvent] = Ends()
        self.begin: float | None = None  #: stamp of the first frame
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
        self._bits[int((stamp - self.begin) // LOAD_WINDOW)] += load_bits(message.dlc, message.is_extended_id,
                                                                          message.is_remote_frame)
        if message.arbitration_id == NMT and not message.is_extended_id and len(message.data) == NMT_BYTES:
            self._commands.add(ReportedEvent(stamp, str(ForeignCommand(*message.data))))

    def report(self, can_frames: Mapping[str, int] | None) -> BusReport:
        return BusReport(self._load(), None, can_frames, self._gaps, self._commands,
                         tuple(sorted(self._channels)))

    def _load(self) -> LoadCurve | None:
        """Return the load without the last, possibly incomplete window, or None if no window is complete."""
        if self.begin is None or self.end - self.begin < LOAD_WINDOW:
            return None
        windows = int((self.end - self.begin) // LOAD_WINDOW)
        used = {window: bits for window, bits in self._bits.items() if window < windows}
        # Only the ends of an interval without CAN frames are stored, because a clock set forward can make it years
        # long.
        edges = {window + step for window in used for step in (-1, 1)} | {0, windows - 1}
        places = sorted(window for window in edges | set(used) if 0 <= window < windows)
        rates = np.array([used.get(window, 0) for window in places]) / LOAD_WINDOW
        mean = sum(used.values()) / (windows * LOAD_WINDOW)
        shares = None if self._bit_rate is None else read_only(rates / self._bit_rate)
        return LoadCurve(LOAD_WINDOW, read_only(self.begin + np.array(places) * LOAD_WINDOW), read_only(rates), shares,
                       mean if self._bit_rate is None else mean / self._bit_rate)


#: names of the objects that identify a device in a support ticket, by index and sub-index
OBJECTS = {(IDENTITY, 1): 'vendor (0x1018:1)', (IDENTITY, 2): 'product (0x1018:2)',
           (IDENTITY, 3): 'revision (0x1018:3)', (IDENTITY, 4): 'serial number (0x1018:4)',
           (DEVICE_TYPE, 0): 'device type (0x1000)', (DEVICE_NAME, 0): 'device name (0x1008)',
           (HARDWARE_VERSION, 0): 'hardware version (0x1009)', (SOFTWARE_VERSION, 0): 'software version (0x100A)',
           (PRODUCER_HEARTBEAT_TIME, 0): 'heartbeat time read [ms] (0x1017)'}
MOST_VALUES = 4  #: maximum number of values kept per object, because a damaged log may contain a new value each time


class NodeRecords:
    """Collects facts about the nodes from the CAN frames of a log, one frame at a time.

    Parameters
    ----------
    pads
        Pad name by node-ID.
    taken
        COB-IDs of TPDOs and SYNC, which must not be interpreted as EMCYs.
    """

    def __init__(self, pads: Mapping[int, str | None], taken: frozenset[int]):
        self._pads, self._taken = pads, taken
        self._nodes: dict[int, _HeardNode] = {}

    def feed(self, message: can.Message) -> None:
        can_id = message.arbitration_id
        if can_id in self._taken or message.is_extended_id or message.is_error_frame or message.is_remote_frame:
            return
        for base in (HEARTBEAT, EMCY, SDO_RESPONSE, SDO_REQUEST):
            node_id = node_of(can_id, base)
            if node_id is not None and (base != SDO_REQUEST or node_id in self._nodes or node_id in self._pads):
                self._node(node_id).feed(base, bytes(message.data), message.timestamp)

    def reports(self) -> tuple[NodeReport, ...]:
        """Return a report on each node that was heard or belongs to a pad, sorted by node-ID."""
        for node_id in self._pads:
            self._node(node_id)
        return tuple(node.report for _, node in sorted(self._nodes.items()))

    def _node(self, node_id: int) -> '_HeardNode':
        if node_id not in self._nodes:
            self._nodes[node_id] = _HeardNode(node_id, self._pads.get(node_id))
        return self._nodes[node_id]


class _HeardNode:
    def __init__(self, node_id: int, pad: str | None) -> None:
        self.report = NodeReport(node_id, pad, heartbeats=0)
        self._uploads = {key: SdoUpload(*key) for key in OBJECTS}
        self._state: int | None = None
        self._last: float | None = None  # stamp of the last heartbeat

    def feed(self, base: int, data: bytes, stamp: float) -> None:
        if base == HEARTBEAT:
            self._heartbeat(data, stamp)
        elif base == EMCY:
            emergency = decode_emergency(data, stamp)
            self.report.emergencies.add(ReportedEvent(stamp, str(emergency), not emergency.is_reset))
        else:
            self._transfer(base == SDO_REQUEST, data)

    def _heartbeat(self, data: bytes, stamp: float) -> None:
        report, state = self.report, nmt_state(data)
        if state is None:
            return
        if state == NmtState.BOOT_UP or state != self._state:
            report.add_state(stamp, state)
        if state == NmtState.BOOT_UP:
            self._last = None
        else:
            report.heartbeats = (report.heartbeats or 0) + 1
            if self._last is not None:
                report.longest_pause = max(report.longest_pause or 0.0, stamp - self._last)
            self._last = stamp
        self._state = state

    def _transfer(self, is_request: bool, data: bytes) -> None:
        for key, upload in self._uploads.items():
            step = upload.request(data) if is_request else upload.response(data)
            values = self.report.objects.get(key, ())
            if step is UploadStep.DONE and upload.data not in values and len(values) < MOST_VALUES:
                self.report.objects[key] = *values, upload.data
