"""Keeps a skin bus going: judges bus and nodes, mends what has failed, and says what it waits for.

Two levels. A *bus* that fails (adapter gone, network down, bus-off) is closed and opened anew, with all that
belongs to it. A *node* that has started anew, is silent, not OPERATIONAL or without taxels is configured and
started again, while SYNC and the other pads go on. Between two attempts of either kind the pause doubles.
"""

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from tactile_node.canbus.bus_load import BusLoad
from tactile_node.canbus.bus_monitor import BusMonitor
from tactile_node.canbus.bus_settings import BusSettings
from tactile_node.canbus.consumer import OnFrame
from tactile_node.canbus.health import BusHealth
from tactile_node.canbus.losses import PadStatistics
from tactile_node.canbus.node_watch import Ailment, NodeWatch, Trouble
from tactile_node.canbus.outage import Backoff, OutageClock, Reminder
from tactile_node.canbus.pads import PadSettings
from tactile_node.canbus.router import BusStatistics
from tactile_node.canbus.skin_bus import SkinBus
from tactile_node.canbus.taxel_codec import without_values
from tactile_node.errors import BusError, DeviceAbsentError, DeviceError, LogError
from tactile_node.taxel_frame import TaxelFrame

logger = logging.getLogger(__name__)
Outcome = TypeVar('Outcome')

PERIOD = 0.02  # s between two judgements when nothing asks for one earlier
FIRST_TRIES = 3  # configurations of a device that boots again meanwhile
REMEDY = ' It is configured and started again.'
REMEDIES = {Ailment.SILENT: ' It is configured and started as soon as it answers.',
            Ailment.NO_SYNC: ' Start that device, or set produce_sync.'}
NO_PATIENCE = 0.3  # s, one SDO request: a device that does not answer now is asked again later


class Supervisor:
    """A SkinBus that mends itself. Implements FrameSource; see there for the order of calls.

    With ``recover=False`` nothing is mended, all is judged and told. ``heartbeat_timeout`` [s] counts also for a
    node never heard. ``open``, ``configure`` and ``start`` raise what SkinBus raises: a bus or device that is
    not there from the beginning is the caller's matter. But while one pad of several is there, the absent ones are
    told, and join when they come.
    """

    def __init__(self, settings: BusSettings, pads: tuple[PadSettings, ...], on_frame: OnFrame,
                 log: Callable[[str], None] = logger.info, complain: Callable[[str], None] = logger.error,
                 recover: bool = True, heartbeat_timeout: float = 0.5):
        self._settings, self._on_frame, self._log, self._complain = settings, on_frame, log, complain
        self._recover = recover
        self._wake, self._closing, self._turn = threading.Event(), threading.Event(), threading.RLock()
        self.monitor = BusMonitor([node_id for pad in pads for node_id in pad.node_ids], self._wake.set)
        self._bus = SkinBus(settings, pads, self._deliver, log, complain, self.monitor,
                            self._bus_failed if recover else None)
        timeouts = self._timeouts(heartbeat_timeout)
        self._by_pad = {pad.name: [NodeWatch(node, self.monitor, *timeouts, i)
                                   for i, node in enumerate(pad.nodes)] for pad in pads}
        self._nodes = [node for nodes in self._by_pad.values() for node in nodes]
        self._outage, self._backoff = OutageClock(), Backoff()
        self._reminder, self._others = Reminder(), Reminder()
        self._load = BusLoad(settings.bitrate)
        self._is_configured = self._is_active = False
        self._heard_then = self._commands_told = 0
        self._silent_since: float | None = None  # no SYNC, so no sequence numbers, since then
        self._thread: threading.Thread | None = None

    @property
    def failure(self) -> str | None:
        """Why nothing is received, None while the bus works."""
        return self._outage.reason if self._outage.is_running else self._bus.failure

    def open(self) -> None:
        with self._turn:
            self._bus.open()
            if self._thread is None:
                self._begin()
                self._closing.clear()
                self._thread = threading.Thread(target=self._supervise, name='supervisor', daemon=True)
                self._thread.start()

    def configure(self) -> None:
        with self._turn:
            absent = [error for error in self._at_once(self._nodes, self._configured_at_start) if error is not None]
            if absent and (not self._recover or len(absent) == len(self._nodes)):
                raise absent[0]
            for error in absent:
                self._complain(f'{error} The others go on without it; it joins when it comes.')
            self._is_configured = True

    def start(self) -> None:
        with self._turn:
            if self._outage.is_running:
                raise BusError('CAN bus', expected='one that works', got=self._outage.reason,
                               remedy='It is opened again until it works; start once it does.')
            self._bus.start(without=[node.pad.node_id for node in self._nodes if not node.is_trusted])
            self._set_active(True)

    def stop(self) -> None:
        self._is_active = False
        with self._turn:
            self._bus.stop()
            self._set_active(False)

    def close(self) -> None:
        self._closing.set()
        self._wake.set()
        with self._turn:
            self._is_configured = self._is_active = False
            thread, self._thread = self._thread, None
        if thread not in (None, threading.current_thread()):
            thread.join()
        self._bus.close()

    def auto_zero(self, pad: str) -> int:
        return self._bus.auto_zero(pad)

    def adjust(self, drop_incomplete: bool, heartbeat_timeout: float) -> None:
        self._bus.drop_incomplete(drop_incomplete)
        for node in self._nodes:
            node.set_timeouts(*self._timeouts(heartbeat_timeout))

    def statistics(self) -> BusStatistics:
        return self._bus.statistics()

    def health(self) -> BusHealth:
        """State of the bus and its nodes now."""
        now, monitor = time.monotonic(), self.monitor
        nodes = {name: tuple(node.health(now) for node in nodes) for name, nodes in self._by_pad.items()}
        return BusHealth(self.failure, self._is_active, nodes, self._outage.outages(now), self._load.load,
                         monitor.is_error_passive, monitor.error_counters, monitor.foreign_commands,
                         monitor.last_command)

    def _timeouts(self, heartbeat_timeout: float) -> tuple[float, float]:
        """Of heartbeat and of taxels [s]."""
        return heartbeat_timeout, max(heartbeat_timeout, 5 * self._settings.sync_period)

    def _begin(self) -> None:
        now = time.monotonic()
        for clock in (self._outage, *(node.outage for node in self._nodes)):
            if clock.is_running:
                clock.end(now)
        for node in self._nodes:
            node.expect(now)
        self._silent_since = None

    def _set_active(self, is_active: bool) -> None:
        now, pads = time.monotonic(), self.statistics().pads
        for node in self._nodes:
            node.commanded(now, pads[node.pad.name])
            if not is_active and node.outage.is_running:
                node.outage.end(now)
        self._is_active = is_active

    def _supervise(self) -> None:
        while not self._closing.is_set():
            self._wake.wait(PERIOD)
            self._wake.clear()
            with self._turn:
                if not self._closing.is_set():
                    self._attend()

    def _attend(self) -> None:
        """One round; whatever goes wrong in it, the next one comes."""
        try:
            self._load.update(time.monotonic(), self.monitor.bits)
            self._tell_of_others()
            if not self._is_configured:
                return
            if self._recover and (self._bus.failure is not None or self._outage.is_running):
                self._attend_bus(time.monotonic())
            if self._bus.failure is None:
                statistics = self.statistics()
                syncs = self._bus.syncs_sent if self._settings.produce_sync else statistics.can_frames.get('sync', 0)
                in_trouble = [node for node in self._nodes
                              if self._attend_node(node, statistics.pads[node.pad.name], syncs)]
                self._at_once(in_trouble, self._mend)
        except Exception:
            logger.exception('supervision of the bus')

    def _bus_failed(self, failure: str) -> None:
        """On any thread: tell it once and let the supervisor act."""
        if not self._outage.is_running:
            self._complain(f'CAN bus has failed: {failure.rstrip(".")}. It is closed and opened again until it works.')
        self._wake.set()

    def _attend_bus(self, now: float) -> None:
        failure = self._bus.failure
        if failure is None:
            if self.monitor.can_frames > self._heard_then:
                self._log(f'CAN bus works again after {self._outage.end(now):.2f} s.')
                self._backoff.reset()
            return
        self._outage.begin(now, failure)
        for node in self._nodes:
            node.outage.begin(now, f'the bus has failed: {failure}')
        if self._backoff.is_due(now):
            self._reopen()
            self._backoff.attempted(time.monotonic())

    def _reopen(self) -> None:
        """Everything anew: bus, notifier, queue; the counts go on."""
        self._bus.disconnect()
        self._silent_since = self._silent_since or time.monotonic()
        try:
            self._bus.open()
            self._heard_then = self.monitor.can_frames
            if self._is_active:
                self._bus.resume(int((time.monotonic() - self._silent_since) / self._settings.sync_period))
                self._silent_since = None
        except (BusError, LogError) as error:
            self._remind(self._reminder, f'Waiting for the CAN bus: {error}')
            return
        for node in self._nodes:
            node.expect(time.monotonic())

    def _attend_node(self, node: NodeWatch, pad: PadStatistics, syncs: int) -> bool:
        """Judge it and tell; whether it is to be mended now."""
        now = time.monotonic()
        if sentence := node.new_emergency(now):
            self._complain(sentence)
        trouble = node.judge(now, self._is_active, pad, syncs)
        if trouble is None:
            self._end_outage(node, pad, now)
            return False
        if trouble.is_outage and self._is_active:
            node.outage.begin(node.data_at, trouble.ailment.value)
        if node.reminder.is_due(trouble.ailment.value, now):
            self._complain(trouble.sentence + (REMEDIES.get(trouble.ailment, REMEDY) if self._recover else ''))
        return self._recover and node.backoff.is_due(now)

    def _end_outage(self, node: NodeWatch, pad: PadStatistics, now: float) -> None:
        if node.outage.is_running:
            if self._is_active and not node.has_taxels_again(pad):
                return
            cause, again = node.outage.cause, 'gives taxels' if self._is_active else 'is ready'
            self._log(f'{node.who} {again} again after {node.outage.end(now):.2f} s; the outage: {cause}.')
        node.recovered()

    def _mend(self, node: NodeWatch) -> None:
        if node.trouble.ailment is not Ailment.NO_SYNC:
            self._try_to_mend(node, node.trouble)
        node.backoff.attempted(time.monotonic())

    def _try_to_mend(self, node: NodeWatch, trouble: Trouble) -> None:
        try:
            if trouble.needs_configuration:
                self._configure(node, NO_PATIENCE, pause=trouble.is_outage)
            if self._is_active:
                self._bus.start_node(node.pad, trouble.is_outage)
                node.commanded(time.monotonic(), self.statistics().pads[node.pad.name])
        except (DeviceError, BusError) as error:
            if trouble.ailment is not Ailment.SILENT:
                self._remind(node.mending, f'Waiting for node {node.pad.node_id}: {error}')

    def _configured_at_start(self, node: NodeWatch) -> DeviceAbsentError | None:
        """None when it is configured, the error when it does not answer; any other is raised."""
        try:
            self._configure(node, self._settings.boot_timeout, FIRST_TRIES)
        except DeviceAbsentError as error:
            return error
        return None

    def _at_once(self, nodes: list[NodeWatch], act: Callable[[NodeWatch], Outcome]) -> list[Outcome]:
        """What ``act`` returns of each, in their order: most of its time it waits for the node's answers."""
        if len(nodes) < 2:
            return [act(node) for node in nodes]
        with ThreadPoolExecutor(len(nodes), 'configure') as pool:
            return list(pool.map(act, nodes))

    def _configure(self, node: NodeWatch, patience: float, tries: int = 1, pause: bool = True) -> None:
        """Configure a node; when it boots meanwhile, once more, as long as there are tries."""
        for _ in range(tries):
            boots = node.boots
            self._bus.configure_node(node.pad, patience, pause)
            node.configured(boots)
            if node.is_trusted:
                return

    def _tell_of_others(self) -> None:
        if self.monitor.foreign_commands != self._commands_told and self._others.is_due('NMT', time.monotonic()):
            self._commands_told = self.monitor.foreign_commands
            self._complain(f'Another NMT master has told {self.monitor.last_command}.')

    def _remind(self, reminder: Reminder, sentence: str) -> None:
        if reminder.is_due(sentence, time.monotonic()):
            self._complain(sentence)

    def _deliver(self, name: str, frame: TaxelFrame) -> None:
        for node in self._by_pad[name]:
            if not node.is_trusted:
                node.distrusted += 1
                frame = without_values(frame, node.pad.layout.carriers)
        self._on_frame(name, frame)
