"""Play a recorded CAN log in place of a bus, with the same assemblers and counters, and with the log's stamps."""

import itertools
import logging
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import can

from tactile_node.assembly.facts import BusFacts
from tactile_node.assembly.fault_text import node_label, order_text
from tactile_node.assembly.health import BusFault, Failure
from tactile_node.assembly.router import OnFrame, Router, non_data_kind
from tactile_node.cia301.objects import HEARTBEAT, SDO_REQUEST, SDO_RESPONSE
from tactile_node.errors import DeviceError, LogError
from tactile_node.logs.log_lines import OneBus
from tactile_node.logs.log_reader import SET_BACK, CanLogReader
from tactile_node.logs.logged_set_up import HeardNodes, LoggedSetUp
from tactile_node.logs.replay_times import WHOLE, PlayedTimes, RecordedPace, TimeWindow
from tactile_node.skin.pads import PadSettings, check_pads, identities_of
from tactile_node.threads import StoppableThread

logger = logging.getLogger(__name__)


class LogSource:
    """A FrameSource that plays a CAN log.

    ``stop`` pauses the log, and ``start`` continues at the next CAN frame. Playback stops with a failure if the device
    setup in the log contradicts the layout or the identity in the EDS.

    Parameters
    ----------
    path
        Path of the log.
    pads
        Pads whose taxel frames are assembled.
    on_frame
        Called with each taxel frame on the replaying thread. A slow consumer slows playback down, but no frames are
        lost.
    pace
        1.0 for the recorded pace, 2.0 for twice as fast, or None for as fast as possible.
    drop_incomplete
        True to drop taxel frames with missing CAN frames.
    channel
        Bus to play if the log contains several buses. ``channel`` is required if SYNC, TPDOs or the pads' nodes are on
        two buses.
    eds
        EDS of each pad, or one EDS for all pads, where '' means the EDS next to the layout.
    any_device
        True to play the log even if it contradicts the layout or the EDS.
    on_message
        Called with each CAN frame before it is played.
    window
        Part of the log to play. CAN frames before this part are not checked.

    Attributes
    ----------
    reader
        Reader of the log, which also lists the unreadable parts.
    finished
        Event that is set when playback has ended or failed.
    failure
        Reason why the log could not be played to the end, or None.

    Raises
    ------
    LogError
        Raised if the log is missing.
    """

    def __init__(self, path: str, pads: tuple[PadSettings, ...], on_frame: OnFrame, pace: float | None = 1.0,
                 drop_incomplete: bool = False, channel: str = '', eds: Sequence[str] = ('',),
                 any_device: bool = False, on_message: Callable[[can.Message], object] = lambda message: None,
                 window: TimeWindow = WHOLE):
        check_pads(pads)
        self._path = path
        self._pace = pace
        # a taxel frame counts as acquired when its stamp was played
        self._played = PlayedTimes()
        self._router = Router(tuple(pads), on_frame, self._played.time_of, drop_incomplete=drop_incomplete)
        self.reader = CanLogReader(path, channel, window)
        self._messages: Iterator[can.Message] | None = None
        self.heard = HeardNodes(pads)
        self._set_up = None if any_device else LoggedSetUp(pads, identities_of(pads, eds))
        self._one_bus = OneBus(_of_pads(pads) | set(self._router.can_ids))
        self._thread = StoppableThread(self._play, 'replay', self._died)
        self.finished = threading.Event()
        self._jumps = 0  # number of times that the clock was set back during recording
        self._ahead = 0.0  # offset of the played stamps from the log's clock [s]
        self._is_active = False
        self._on_message = on_message
        self.failure: Failure | None = None

    def open(self) -> None:
        """Open the log. Raises LogError if the log cannot be read or contains no CAN frame."""
        if self._messages is not None:
            return
        self.finished.clear()
        messages = self._all_messages()
        # Reading one message here lets `open` raise LogError for an unreadable log.
        self._messages = itertools.chain([next(messages)], messages)
        logger.info('Playing %s.', self._path)

    def configure(self) -> None:
        """Do nothing, because a log has no devices."""

    def start(self) -> None:
        if self._messages is not None:
            self._is_active = True
            self._thread.start()

    def play(self, stop_requested: threading.Event) -> None:
        """Play the log on this thread, to its end or until ``stop_requested`` is set, and close it.

        Raises
        ------
        LogError
            Raised if the log cannot be read to its end, or if a taxel frame could not be processed.
        """
        self.open()
        self._is_active = True
        self._play(stop_requested)
        self.close()
        if self.failure or self.facts().consumer_errors:
            raise LogError(self._path, expected='a log that can be played to the end',
                           got=self.failure.detail.removesuffix('.') if self.failure else 'an error in a taxel frame',
                           remedy='The frames before the error are not used.')

    def stop(self) -> None:
        self._is_active = False
        self._thread.stop()

    def close(self) -> None:
        self.stop()
        self._messages = None

    def auto_zero(self, pad: str) -> int:
        raise DeviceError(f'pad {pad!r}', expected='a device that zeroes itself', got=f'the log {self._path}',
                          remedy='Tare without on_device.')

    def boots(self, pad: str) -> int:
        """Return 0, because a log has no devices that restart."""
        return 0

    def adjust(self, drop_incomplete: bool, heartbeat_timeout: float) -> None:
        """Set ``drop_incomplete``. The timeout is ignored, because the heartbeats in a log are not supervised."""
        self._router.withhold_incomplete(drop_incomplete)

    def facts(self) -> BusFacts:
        """Return the facts about the log. A log has no nodes, so it can only fail as a whole."""
        return replace(self._router.facts(), failure=self.failure, active=self._is_active,
                       unread_log_lines=self.reader.unread, clock_jumps=self._jumps,
                       stamps_ahead=self._ahead)

    def _all_messages(self) -> Iterator[can.Message]:
        last = None
        self._ahead = 0.0
        for message in self._past_gaps():
            message.timestamp += self._ahead
            if last is not None and message.timestamp < last - SET_BACK:  # the clock was set back during recording
                self._jumps += 1
                self._ahead += last - message.timestamp
                message.timestamp = last
            last = message.timestamp
            yield message

    def _past_gaps(self) -> Iterator[can.Message]:
        """Yield the messages, and end the SYNC period at each gap.

        Even if the SYNC after a gap is lost, TPDOs after the gap must not complete the sweep from before the gap.
        The reader looks ahead by one message, so a gap lies before either this message or the next one.
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
                self._on_message(message)
                self._check(message)
                self.heard.feed(message)
                self._router.feed_message(message)
                if stopping.is_set():
                    return
        except LogError as error:
            self._fail(BusFault.LOG_UNUSABLE, str(error))
        self._router.end()
        for counted in self._router.facts().pads:
            for order in filter(None, counted.orders):
                logger.warning('%s, %s: %s.', self._path, node_label(counted.pad, order.node_id), order_text(order),
                               extra={'fact': order})
        for pad, strangers in self.heard.strangers().items():
            logger.warning('%s: pad %s sent no heartbeat, but node %s did and sends some of the same COB-IDs. '
                           'Check the node-IDs, because the taxels may belong to other pads.', self._path, pad,
                           ', '.join(map(str, strangers)))
        self.finished.set()
        logger.info('The log %s has ended: %s', self._path, self.reader.summary)

    def _check(self, message: can.Message) -> None:
        """Raise LogError for a second bus or a contradiction.

        Without this check, two skins with the same node-ID on two buses would be merged, and a different mapping would
        put taxels in the wrong places.
        """
        if buses := self._one_bus.feed(message):
            raise LogError(self._path, expected='CAN frames of the pads and SYNC on one bus', got=buses,
                           remedy='Name the bus to play with replay_channel, or with --channel of tactile replay.')
        if self._set_up is None or non_data_kind(message) is not None:
            return
        found = self._set_up.feed(message.arbitration_id, bytes(message.data))
        if found is not None:
            raise LogError(f'{self._path}, {node_label(found.pad, found.node_id)}, object 0x{found.object_index:04X}',
                           expected=found.expected, got=f'{found.got} according to the SDO responses in the log',
                           remedy='Give the layout of the recorded device (--layout).')

    def _died(self, error: Exception) -> None:
        self._fail(BusFault.INTERNAL_ERROR, f'{self._path}: {type(error).__name__}: {error}')
        self.finished.set()

    def _fail(self, fault: BusFault, detail: str) -> None:
        self.failure = Failure(fault, detail)
        logger.error('%s', self.failure, extra={'fact': fault})


def _of_pads(pads: Sequence[PadSettings]) -> set[int]:
    """Return all COB-IDs, except those of TPDOs, that must come from a single bus."""
    nodes = [node_id for pad in pads for node_id in pad.node_ids]
    return {pad.layout.sync_cob_id for pad in pads} | {
        base + node_id for base in (HEARTBEAT, SDO_REQUEST, SDO_RESPONSE) for node_id in nodes}


UNREAD_EXIT = 3  #: exit code if the only problem is an unreadable part of the log


def summary(facts: BusFacts) -> str:
    """Return a table that counts the published taxel frames, and the used and the lost CAN frames."""
    lines = []
    for pad in facts.pads:
        fates = {'used': pad.tpdos_used} | {reason.key: count for reason, count in pad.losses.items() if count}
        lines.append(f'{pad.pad}: {pad.published} taxel frames, {pad.frames_complete} complete, '
                     f'{pad.frames_incomplete} incomplete; TPDOs: {pad.tpdos_expected} expected, '
                     f'{pad.missing} brought no taxels; {pad.tpdos_received} received: ' +
                     ', '.join(f'{count} {fate}' for fate, count in fates.items()) +
                     (f'; {pad.tpdos_padded} padded' if pad.tpdos_padded else ''))
    services = ', '.join(f'{count} {service}' for service, count in sorted(facts.can_frames.items()))
    lines.append(f'CAN frames: {sum(facts.can_frames.values())} ({services}); lines unread: {facts.unread_log_lines}')
    return '\n'.join(lines)
