"""Plays a recorded CAN log in place of a bus: same assemblers, same counts, the log's own stamps."""

import itertools
import logging
import threading
from collections.abc import Callable, Iterator, Sequence

import can

from tactile_node.assembly.fault_text import failure_text, node_label, order_text
from tactile_node.assembly.frame_source import BusStatistics, OnFrame
from tactile_node.assembly.health import BusFault, BusHealth, Failure
from tactile_node.assembly.router import Router, non_data_kind
from tactile_node.bus.threads import StoppableThread
from tactile_node.cia301.objects import HEARTBEAT, SDO_REQUEST, SDO_RESPONSE
from tactile_node.errors import DeviceError, LogError
from tactile_node.logs.log_lines import OneBus
from tactile_node.logs.log_reader import SET_BACK, CanLogReader
from tactile_node.logs.logged_set_up import HeardNodes, LoggedSetUp
from tactile_node.logs.replay_times import WHOLE, PlayedTimes, RecordedPace, TimeWindow
from tactile_node.skin.pads import PadSettings, check_pads, identities_of

logger = logging.getLogger(__name__)


class LogSource:
    """A log as FrameSource. ``pace`` 1.0 is the recorded one, 2.0 twice as fast, None as fast as possible.

    ``on_frame`` is called in step on the replaying thread, so a slow consumer slows the log and loses
    nothing. With ``loop`` the log begins again at its end, stamps shifted by its length. ``stop`` pauses,
    ``start`` continues at the next CAN frame. ``finished`` is set when the log has ended, ``failure`` when it
    could not be played to its end. ``channel`` chooses one bus of a log of several; needed where SYNC, TPDOs or the
    pads' nodes are on two. ``on_time`` is called with the stamp [s] of each CAN frame before it is played,
    ``on_message`` with the frame. Where the set-up in the log contradicts the layout, or the identity in the pad's EDS
    (``eds``, one for each or for all; empty: that beside the layout), the log is not played on, unless with
    ``any_device``. Of the log ``window`` is played; what comes before it is not judged. Raises LogError when it is
    missing.
    """

    def __init__(self, path: str, pads: tuple[PadSettings, ...], on_frame: OnFrame, pace: float | None = 1.0,
                 loop: bool = False, drop_incomplete: bool = False, channel: str = '',
                 on_time: Callable[[float], None] | None = None, eds: Sequence[str] = ('',), any_device: bool = False,
                 on_message: Callable[[can.Message], None] | None = None, window: TimeWindow = WHOLE):
        check_pads(pads)
        self._path = path
        self._pace = pace
        self._loop = loop
        self._router = Router(tuple(pads), on_frame, drop_incomplete=drop_incomplete)
        self.reader = CanLogReader(path, channel, window)  #: has what was read so far, and what could not be
        self._messages: Iterator[can.Message] | None = None
        self.heard = HeardNodes(pads)
        self._set_up = None if any_device else LoggedSetUp(pads, identities_of(pads, eds))
        self._one_bus = OneBus(_of_pads(pads) | set(self._router.can_ids))
        self._thread = StoppableThread(self._play, 'replay', self._died)
        self.finished = threading.Event()  #: the log has ended, or failed
        self._unread = 0  # lines in the rounds before this one
        self._jumps = 0  # steps of the clock, while recording
        self._ahead = 0.0  # lead over the log's clock [s]
        self._is_active = False
        self._played = PlayedTimes()
        self._on_time = on_time
        self._on_message = on_message
        self.failure: Failure | None = None

    def open(self) -> None:
        """Open the log; LogError when it is unreadable or without a CAN frame."""
        if self._messages is not None:
            return
        self.finished.clear()
        messages = self._all_messages()
        self._messages = itertools.chain([next(messages)], messages)  # raises LogError now rather than on the thread
        logger.info('Playing %s.', self._path)

    def configure(self) -> None:
        """Nothing to configure: a log has no devices."""

    def start(self) -> None:
        if self._messages is not None:
            self._is_active = True
            self._thread.start()

    def stop(self) -> None:
        self._is_active = False
        self._thread.stop()

    def close(self) -> None:
        self.stop()
        self._messages = None

    def age(self, stamp: float) -> float:
        """Time since what is stamped ``stamp`` was played [s]; of what was played long ago, too short."""
        return self._played.age(stamp)

    def auto_zero(self, pad: str) -> int:
        raise DeviceError(f'pad {pad!r}', expected='a device that zeroes itself', got=f'the log {self._path}',
                          remedy='Tare without on_device.')

    def boots(self, pad: str) -> int:
        """A log has no devices that boot again."""
        return 0

    def adjust(self, drop_incomplete: bool, heartbeat_timeout: float) -> None:
        """A log has no heartbeats to supervise."""
        self._router.drop_incomplete(drop_incomplete)

    def statistics(self) -> BusStatistics:
        return self._router.statistics()._replace(unread=self._unread + self.reader.unread, clock_jumps=self._jumps,
                                                  stamps_ahead=self._ahead)

    def health(self) -> BusHealth:
        """A log has no nodes; it can only fail as a whole."""
        return BusHealth(self.failure, self._is_active)

    def _all_messages(self) -> Iterator[can.Message]:
        shift = 0.0
        while True:
            first = last = None
            self._ahead = 0.0
            for message in self._past_gaps():
                message.timestamp += self._ahead
                if last is not None and message.timestamp < last - SET_BACK:  # the clock was set while recording
                    self._jumps += 1
                    self._ahead += last - message.timestamp
                    message.timestamp = last
                first = message.timestamp if first is None else first
                last = message.timestamp
                message.timestamp += shift
                yield message
            if not self._loop or first is None or last is None:
                return
            self._router.end()  # or the log's first CAN frames would complete its last sweep
            self._unread += self.reader.unread
            shift += last - first

    def _past_gaps(self) -> Iterator[can.Message]:
        """End the period at a gap, or the TPDOs after it, whose SYNC may be lost, would complete the sweep before it.

        The reader looks ahead by one message, so that a gap lies before this one or before the next.
        """
        known = near = 0
        for message in self.reader:
            if len(self.reader.damages) > known:
                known, near = len(self.reader.damages), 2
            if near:
                near -= 1
                self._router.end()
            yield message

    def _play(self, stopping: threading.Event) -> None:
        clock = RecordedPace(self._pace, stopping)
        try:
            for message in self._messages or ():
                clock.wait_until(message.timestamp)
                self._played.note(message.timestamp)
                if self._on_time is not None:
                    self._on_time(message.timestamp)
                self._check(message)
                if self._on_message is not None:
                    self._on_message(message)
                self.heard.feed(message)
                self._router.feed_message(message)
                if stopping.is_set():
                    return
        except LogError as error:
            self._fail(BusFault.LOG_UNUSABLE, str(error))
        self._router.end()
        for pad, statistics in self._router.statistics().pads.items():
            for order in filter(None, statistics.orders):
                logger.warning('%s, %s: %s.', self._path, node_label(pad, order.node_id), order_text(order),
                               extra={'fact': order})
        for pad, strangers in self.heard.strangers().items():
            logger.warning('%s: no heartbeat of pad %s, but those of node %s, which sends some of the same COB-IDs. '
                           'Check the node-IDs: the taxels may be of other pads.', self._path, pad,
                           ', '.join(map(str, strangers)))
        self.finished.set()
        logger.info('%s has ended: %s', self._path, self.reader.summary)

    def _check(self, message: can.Message) -> None:
        """Two skins of the same node-ID on two buses would become one; with another mapping, taxels change places."""
        if (buses := self._one_bus.feed(message)) is not None:
            raise LogError(self._path, expected='CAN frames of the pads and SYNC on one bus',
                           got=f'0x{buses.can_id:03X} on {" and on ".join(buses.channels)}',
                           remedy='Name the bus to play: replay_channel, or --channel of tactile replay.')
        if self._set_up is None or non_data_kind(message) is not None:
            return
        found = self._set_up.feed(message.arbitration_id, bytes(message.data))
        if found is not None:
            raise LogError(f'{self._path}, {node_label(found.pad, found.node_id)}, object 0x{found.object_index:04X}',
                           expected=found.expected, got=f"{found.got} by the log's SDO answers",
                           remedy='Give the layout and EDS of the device that was recorded.')

    def _died(self, error: Exception) -> None:
        self._fail(BusFault.INTERNAL_ERROR, f'{self._path}: {type(error).__name__}: {error}')
        self.finished.set()

    def _fail(self, fault: BusFault, detail: str) -> None:
        self.failure = Failure(fault, detail)
        logger.error('%s', failure_text(self.failure), extra={'fact': fault})


def _of_pads(pads: Sequence[PadSettings]) -> set[int]:
    """COB-IDs beside those of taxels that must be of one bus."""
    nodes = [node_id for pad in pads for node_id in pad.node_ids]
    return {pad.layout.sync_cob_id for pad in pads} | {
        base + node_id for base in (HEARTBEAT, SDO_REQUEST, SDO_RESPONSE) for node_id in nodes}


UNREAD_EXIT = 3  #: exit code where all else is well, but something in the log could not be read


def summary(statistics: BusStatistics) -> str:
    """Return a table of what was published and the fate of every CAN frame."""
    lines = []
    for name, pad in statistics.pads.items():
        fates = {'used': pad.used} | {reason.key: count for reason, count in pad.losses.items() if count}
        lines.append(f'{name}: {pad.published} taxel frames, {pad.complete} complete, {pad.incomplete} incomplete; '
                     f'TPDOs: {pad.expected} expected, {pad.missing} brought no taxels; {pad.received} received: ' +
                     ', '.join(f'{count} {fate}' for fate, count in fates.items()) +
                     (f'; {pad.padded} padded' if pad.padded else ''))
    services = ', '.join(f'{count} {service}' for service, count in sorted(statistics.can_frames.items()))
    lines.append(f'CAN frames: {sum(statistics.can_frames.values())} ({services}); lines unread: {statistics.unread}')
    return '\n'.join(lines)
