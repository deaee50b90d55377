"""Operate a live CAN bus with the pads of a skin: open, configure, start, stop and close it."""

import logging
import time
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path

import can

from tactile_node.assembly.facts import BusFacts
from tactile_node.assembly.fault_text import node_label
from tactile_node.assembly.health import BusFault, Failure
from tactile_node.assembly.router import OnFrame, Router
from tactile_node.bus.bus_devices import BusDevices
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.bus_network import BusNetwork
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.can_queue import CanQueue
from tactile_node.bus.device_setup import DeviceAsSet
from tactile_node.bus.domain_polling import DomainPolling
from tactile_node.bus.load import refuse_full_bus
from tactile_node.bus.open_bus import check_bit_rate, open_bus
from tactile_node.bus.stamp_clock import StampClock
from tactile_node.bus.sync_producer import SyncProducer
from tactile_node.bus.usb_port import UsbPort
from tactile_node.chain import Chain
from tactile_node.cia301.objects import NmtCommand
from tactile_node.errors import BusError, DeviceError, LogError
from tactile_node.logs.log_writer import CanLogWriter
from tactile_node.skin.layout import DomainLayout
from tactile_node.skin.pads import CanopenNode, LivePad, check_pads, live_pads

logger = logging.getLogger(__name__)

#: Interfaces that stamp each CAN frame on arrival, with the wall clock of this host.
STAMPED_ON_ARRIVAL = ('socketcan', 'virtual')


class SkinBus:
    """One CAN bus and its pads.

    `FrameSource` defines the order of the calls, and a `Supervisor` recovers the bus after faults.

    The reception thread posts frames to the chain (`CanQueue`). The chain thread assembles the frames and calls
    ``on_frame``. The SYNC producer runs on a separate thread. SDO requests run on the thread of the caller.

    Parameters
    ----------
    settings : BusSettings
        Settings of the bus.
    pads : tuple of LivePad
        Pads on the bus.
    on_frame : callable
        Function that is called with the name of the pad and each taxel frame.
    monitor : BusMonitor or None
        Monitor that the bus feeds; None to create one.
    on_failure : callable or None
        Function that is called with a `Failure` when the bus stops working; None to log the failure.
    chain : Chain or None
        Running chain that assembles the frames, or None if the bus must start a separate chain.

    Raises
    ------
    ConfigurationError
        Raised if the pads conflict, the bit rate is not standard, or the planned load is too high.
    """

    def __init__(self, settings: BusSettings, pads: tuple[LivePad, ...], on_frame: OnFrame,
                 monitor: BusMonitor | None = None, on_failure: Callable[[Failure], None] | None = None,
                 chain: Chain | None = None):
        check_pads(pads)
        check_bit_rate(settings.bitrate)  # this check comes first, because the load depends on the bit rate
        if not settings.allow_full_bus:
            refuse_full_bus((pad.layout for pad in pads), settings.bitrate, settings.sync_period)
        self._settings = settings
        self._pads = live_pads(pads)
        self._nodes = [node for pad in self._pads for node in pad.nodes]
        self._on_failure = on_failure or self._log_failure
        self._monitor = monitor or BusMonitor(node_id for pad in pads for node_id in pad.node_ids)
        self.devices = BusDevices(settings, self._nodes, self._monitor, self._opened)
        self._polls = {node.node_id: self._polling(node, node.layout.domain)
                       for node in self._nodes if node.layout.domain is not None}
        clock = StampClock(host_stamped=settings.interface in (*STAMPED_ON_ARRIVAL, 'slcan'))
        self._router = Router(self._pads, on_frame, clock.acquired, foreign_sync=not settings.produce_sync,
                              one_clock=_is_one_clock(settings),
                              drop_incomplete=settings.drop_incomplete, bitrate=settings.bitrate)
        self.queue = CanQueue(self._router, self._monitor, self._fail, polled=self._polls.keys(),
                              queue_limit=settings.queue_limit, clock=clock, chain=chain)
        self._port = UsbPort(settings.channel) if settings.interface == 'slcan' else None
        self._network: BusNetwork | None = None
        self._record: CanLogWriter | None = None
        self.sync = SyncProducer(settings.sync_period, self._pads[0].layout.sync_cob_id, self._opened, self.queue,
                                 self._router, self._fail)
        self._is_running = False
        #: reason why the bus has stopped working, or None; only close() and open() recover the bus
        self.failure: Failure | None = None

    @property
    def recorded_to(self) -> Path | None:
        """Path of the log file being written, or None if there is no recording.

        If the requested file already existed, the bus writes to another file and returns that file's path.
        """
        return None if self._record is None else self._record.path

    def open(self) -> None:
        """Open the bus and start receiving.

        Raises
        ------
        BusError
            Raised if the bus cannot be opened.
        LogError
            Raised if the recording cannot be written.
        """
        if self._network is not None:
            return
        settings = self._settings
        channel = settings.channel if self._port is None else self._port.channel()
        bus = open_bus(settings.interface, channel, settings.bitrate)
        if self._port is not None:
            self._port.opened()
        record = self._open_record(bus)
        self.failure = None
        self._monitor.restart()
        self._router.pause()
        self.queue.begin()
        self._network = BusNetwork(bus, self.queue.received, self._fail, record,
                                   name=f'{settings.interface} {settings.channel}', on_sent=self.queue.sent)
        recorded = f', recorded to {record.path}' if record else ''
        logger.info('CAN bus %s %s is open%s.', settings.interface, settings.channel, recorded)

    def configure(self) -> None:
        """Find, identify and configure the devices of all pads. Raises DeviceError, BusError."""
        for node in self._nodes:
            self.configure_node(node, self._settings.boot_timeout)

    def configure_node(self, node: CanopenNode, boot_timeout: float, pause: bool = True) -> DeviceAsSet:
        """Configure the device of one node.

        Parameters
        ----------
        node : CanopenNode
            Node of a pad.
        boot_timeout : float
            Time allowed for the first answer of the device [s].
        pause : bool
            True to set the device to PRE-OPERATIONAL first, so that the device sends no TPDOs while it is configured.

        Returns
        -------
        DeviceAsSet
            Settings of the device after the configuration.

        Raises
        ------
        DeviceError
            Raised if the device is absent, has another identity, or rejects the configuration.
        TwoDevicesError
            Raised if two devices answer with this node-ID.
        BusError
            Raised if the bus cannot be used.
        """
        as_set = self.devices.configure(node, boot_timeout, pause)
        if node.node_id in self._polls:
            self._polls[node.node_id].by_block = as_set.by_block
        return as_set

    def start(self, without: Collection[int] = ()) -> None:
        """Start the devices and the SYNC producer.

        Parameters
        ----------
        without : collection of int
            Node-IDs of the nodes that do not answer yet. The bus neither starts these nodes nor waits for them.

        Raises
        ------
        DeviceError
            Raised if a device does not become OPERATIONAL.
        BusError
            Raised if a command cannot be sent.
        """
        self._opened()
        if self._is_running:
            return
        self.queue.restart()
        self.sync.pause.restart()
        begun = time.monotonic()
        self._is_running = True  # from here on, stop() has something to undo
        present = [node for node in self._nodes if node.node_id not in without]
        try:
            for node in present:
                self.start_node(node)
            self._start_pacers()
            for node in present:
                self.devices.confirm_operational(node, begun)
        except (DeviceError, BusError):
            self.stop()
            raise

    def start_node(self, node: CanopenNode, was_silent: bool = True) -> None:
        """Send NMT start to one device. The heartbeats of the device show whether it has started.

        Parameters
        ----------
        node : CanopenNode
            Node to start.
        was_silent : bool
            True if the device has not sent TPDOs so far. In that case, the assembler knows that the next TPDOs of the
            device are not late.

        Raises
        ------
        BusError
            Raised if the command cannot be sent.
        """
        if was_silent:
            self.queue.chain.post(self._router.node_started, node.node_id)
        self.devices.command(NmtCommand.START, node)

    def resume(self, lost_periods: int) -> None:
        """Resume SYNC after an outage.

        The sequence numbers skip ``lost_periods``. The method does not start the devices.
        """
        self._opened()
        self.queue.chain.post(self._router.resume, lost_periods)
        self._is_running = True
        self._start_pacers()

    def stop(self) -> None:
        """Stop SYNC and set the devices to PRE-OPERATIONAL. After a bus failure, no command is sent."""
        if self._network is None or not self._is_running:
            return
        self._is_running = False
        self.sync.stop()
        for poll in self._polls.values():
            poll.stop()
        self.queue.chain.post(self._router.pause)
        for node in self._nodes if self.failure is None else ():
            try:
                self.devices.command(NmtCommand.ENTER_PRE_OPERATIONAL, node)
            except BusError as error:
                logger.error('%s could not be stopped: %s', node_label(node.pad, node.node_id), error)

    def close(self) -> None:
        """Stop and close the bus, and end the recording."""
        self.disconnect()
        if self._record is not None:
            self._record.close()
            self._record = None

    def disconnect(self) -> None:
        """Stop and close the bus. The same recording continues at the next ``open``."""
        self.stop()
        if self._network is not None:
            self._network.close()
            self._network = None
            self.queue.end(timeout=2.0)  # a call to on_frame may still be running

    def withhold_incomplete(self, is_wanted: bool) -> None:
        """Withhold incomplete taxel frames from now on if ``is_wanted`` is True; emit them otherwise."""
        self._router.withhold_incomplete(is_wanted)

    def facts(self) -> BusFacts:
        """Return the counts since construction. The state of the bus and its nodes is known to the `Supervisor`."""
        counted, queue = self._router.facts(), self.queue
        can_frames = Counter(counted.can_frames) + Counter(queue.others)
        return replace(
            counted, can_frames=dict(can_frames), error_frames=can_frames['error'], queue_overruns=queue.overruns,
            sync_overruns=self.sync.overruns, sync_pauses=self.sync.pause.count,
            poll_overruns=sum(poll.overruns for poll in self._polls.values()),
            unrecorded_can_frames=0 if self._record is None else self._record.unwritten,
            clock_jumps=queue.clock.jumps, stamps_ahead=queue.clock.ahead)

    def _open_record(self, bus: can.BusABC) -> CanLogWriter | None:
        """Open the recording if one is wanted.

        If the recording cannot be written, close the bus before raising LogError.
        """
        try:
            if self._record is None and self._settings.record:
                self._record = CanLogWriter(self._settings.record, self._settings.channel,
                                            self._settings.record_largest)
        except LogError:
            bus.shutdown()
            raise
        return self._record

    def _opened(self) -> BusNetwork:
        if self._network is None:
            raise BusError('CAN bus', expected='an open bus', got='a closed one', remedy='Call open() first.')
        return self._network

    def _start_pacers(self) -> None:
        if self._settings.produce_sync and any(pad.layout.needs_sync for pad in self._pads):
            self.sync.start()
        for poll in self._polls.values():
            poll.start()

    def _polling(self, node: CanopenNode, domain: DomainLayout) -> DomainPolling:
        return DomainPolling(
            domain, node.label, self._settings.sync_period,
            open_sdo=lambda: self.devices.sdo_client(node), on_failure=self._fail)

    def _fail(self, fault: BusFault, error: Exception) -> None:
        if self.failure is None:
            self.failure = failure = Failure(fault, str(error))
            self._on_failure(failure)

    def _log_failure(self, failure: Failure) -> None:
        logger.error('CAN bus %s %s has failed: %s. Repair it, then deactivate, clean up and configure the driver '
                     'again.', self._settings.interface, self._settings.channel, failure,
                     extra={'fact': failure.fault})


def _is_one_clock(settings: BusSettings) -> bool:
    """Return True if one clock stamps TPDOs and SYNC, so that rule 9 of `sync_assembler` holds.

    If another device produces SYNC, the rule holds for every interface, because SYNC and TPDOs are received and stamped
    in the same way. If this driver produces SYNC, the wall clock of this host stamps SYNC. The rule then holds only for
    interfaces that stamp TPDOs on arrival with the same clock. It does not hold for the others:

    - With slcan, TPDOs are stamped when they are read. A TPDO that arrived before SYNC, but is read after SYNC, has a
      later stamp than SYNC. The stamps therefore do not show the order on the bus.
    - Other adapters stamp with their own clock, whose offset is known only approximately (`StampClock`).
    """
    return not settings.produce_sync or settings.interface in STAMPED_ON_ARRIVAL
