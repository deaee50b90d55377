"""The skin driver: a lifecycle node around one CAN bus, or a recorded log in its place.

configure = open the bus, check identities, write the configuration; activate = NMT start;
deactivate = pre-operational; cleanup = close.
"""

import sys
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from tactile_node.bus.bus_settings import BusSettings
from tactile_node.conditioning.conditioned_pad import ConditionedPad
from tactile_node.conditioning.limits import tare_limit
from tactile_node.conditioning.taxel_faults import FaultyTaxels
from tactile_node.errors import BusError, ConfigurationError, DeviceAbsentError, DeviceError, TactileError
from tactile_node.frames.fault_text import failure_of
from tactile_node.frames.frame_source import FrameSource
from tactile_node.frames.health import BusHealth
from tactile_node.frames.losses import BusStatistics
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.fault_service import FaultService
from tactile_node.nodes.replay_gate import ReplayGate
from tactile_node.nodes.run import run_node
from tactile_node.nodes.tare_service import TareService, Zeroing
from tactile_node.recording.log_source import LogSource
from tactile_node.ros.conditioning_setup import adjust, conditioned_pads
from tactile_node.ros.diagnostics import BusDiagnostics, unconfigured
from tactile_node.ros.lifecycle import outlive_unfitting_requests
from tactile_node.ros.parameters import changed, declare, read
from tactile_node.ros.qos import STATUS_QOS
from tactile_node.ros.rosout_handler import forward_logs_to, stop_forwarding_to
from tactile_node.ros.settings import DriverSettings
from tactile_node.ros.status_message import status_message
from tactile_node.ros.taxel_messages import taxel_array_message
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.pad_rules import live_pads
from tactile_node.skin.pads import PadSettings, make_pads, one_for_each, with_dictionaries
from tactile_node.supervision.supervisor import Supervisor
from tactile_node.threads.reminder import Reminder
from tactile_skin.msg import SkinStatus, TaxelArray

DIAGNOSTICS_PERIOD = 1.0  # [s], REP-107
RETRY_PERIOD = 0.5  # s between two attempts to configure while something is waited for at start


class Pad(NamedTuple):
    """What is needed to publish a pad's frames."""

    publisher: Publisher
    layout: SkinLayout
    frame_id: str
    conditioned: ConditionedPad


class DriverNode(LifecycleNode):
    """Publishes `<pad>/taxels` for each pad while active, /diagnostics and `~/status` always."""

    def __init__(self, **options):
        super().__init__(NODE_NAMES[Role.DRIVER], **options)
        outlive_unfitting_requests(self)
        declare(self, DriverSettings)
        self.add_on_set_parameters_callback(self._on_parameters)
        self._source: FrameSource | None = None
        self._pads: dict[str, Pad] = {}
        self._gate: ReplayGate | None = None
        self._owned: list[Callable[[], object]] = []  # what gives back all that configure has made
        self._error: TactileError | None = None
        self._reminder: Reminder | None = None  # while bus and devices are waited for at start
        self._tare = TareService(self)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', QoSProfile(depth=10))
        self._status = self.create_publisher(SkinStatus, '~/status', STATUS_QOS)
        self.create_timer(DIAGNOSTICS_PERIOD, self._publish_state)
        forward_logs_to(self)

    def autostart(self, asked: threading.Event | None = None) -> None:
        """Configure and activate, as the parameter `autostart` says. Raises what went wrong.

        With `wait_at_start` a bus or device that is not there is waited for until the event ``asked`` is set.
        """
        if not self.get_parameter('autostart').value:
            return
        waits = asked is not None and self.get_parameter('wait_at_start').value
        self._reminder = Reminder() if waits else None
        try:
            while self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
                if not waits or not isinstance(self._error, (BusError, DeviceAbsentError)):
                    raise self._error or _failed('configure')
                if asked.wait(RETRY_PERIOD):
                    return
        except RuntimeError:  # RCLError: whoever else commands the lifecycle has done it meanwhile
            return
        finally:
            self._reminder = None
        if self.trigger_activate() != TransitionCallbackReturn.SUCCESS:
            raise self._error or _failed('activate')

    @property
    def source(self) -> FrameSource | None:
        """The bus or the log, None while unconfigured."""
        return self._source

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        result = self._attempt(self._configure)
        if result != TransitionCallbackReturn.SUCCESS:
            self._release()
        return self._told(result)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._told(self._attempt(self._start))

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._tare.give_up('one that was deactivated')
        return self._told(self._attempt(self._source.stop))

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._release()
        return self._told(TransitionCallbackReturn.SUCCESS)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._release()
        return self._told(TransitionCallbackReturn.SUCCESS)

    def destroy_node(self) -> None:
        self._release()
        if self.context.ok():
            self._publish_state()
        stop_forwarding_to(self)
        super().destroy_node()

    def _told(self, result: TransitionCallbackReturn) -> TransitionCallbackReturn:
        """Publish the state after a transition."""
        self._publish_state()
        return result

    def _attempt(self, step: Callable[[], None]) -> TransitionCallbackReturn:
        """Run a step of the lifecycle; a failure is told once, in a sentence."""
        try:
            step()
        except TactileError as error:
            self._error = error
            if self._reminder is None:
                self.get_logger().error(str(error))
            elif self._reminder.is_due(str(error), time.monotonic()):
                self.get_logger().error(f'{error} It is waited for.')
            return TransitionCallbackReturn.FAILURE
        except Exception:  # rclpy would swallow it without a word
            self._error = None
            self.get_logger().error(traceback.format_exc())
            return TransitionCallbackReturn.FAILURE
        self._error = None
        return TransitionCallbackReturn.SUCCESS

    def _configure(self) -> None:
        settings = read(self, DriverSettings)
        pads = _pads(settings)
        frame_ids = one_for_each('frame_ids', settings.frame_ids, pads)
        conditioned = conditioned_pads(pads, settings)
        self._pads = {pad.name: Pad(self._make_publisher(TaxelArray, f'{pad.name}/taxels', settings.qos), pad.layout,
                                    frame_id or f'{pad.name}_pad', conditioned[pad.name])
                      for pad, frame_id in zip(pads, frame_ids)}
        saving = FaultService(self, settings.faulty_taxels_file, self._faults)
        self._findings = BusDiagnostics(self.get_name(), f'{settings.interface} {settings.channel}')
        source = self._make_source(settings, pads)
        self._tare.begin(Zeroing({name: pad.tared for name, pad in conditioned.items()},
                                 self._tare_limit({pad.name: pad.layout.value.unit for pad in pads}),
                                 settings.sync_period, source.auto_zero, source.boots))
        self._owned += [saving.destroy, self._tare.end, source.close]
        source.open()
        self._source = source
        source.configure()

    def _start(self) -> None:
        self._source.start()
        self._tare.expect()

    def _make_publisher(self, kind: type, topic: str, qos: QoSProfile) -> Publisher:
        publisher = self.create_publisher(kind, topic, qos)
        self._owned.append(lambda: self.destroy_publisher(publisher))
        return publisher

    def _make_source(self, settings: DriverSettings, pads: tuple[PadSettings, ...]) -> FrameSource:
        if settings.replay:
            self._gate = self._make_gate(settings)
            return LogSource(settings.replay, pads, self._publish, pace=settings.replay_pace or None,
                             loop=settings.replay_loop, drop_incomplete=settings.drop_incomplete,
                             channel=settings.replay_channel)
        bus = BusSettings(interface=settings.interface, channel=settings.channel, bitrate=settings.bitrate,
                          sync_period=settings.sync_period, produce_sync=settings.produce_sync,
                          boot_timeout=settings.boot_timeout, drop_incomplete=settings.drop_incomplete,
                          record=settings.record)
        return Supervisor(bus, live_pads(pads), self._publish, recover=settings.recover,
                          heartbeat_timeout=settings.heartbeat_timeout)

    def _make_gate(self, settings: DriverSettings) -> ReplayGate | None:
        """Only a log played as fast as possible needs one, and only where nothing may be lost."""
        if settings.replay_pace or not settings.lossless:
            return None
        gate = ReplayGate(self, settings.pads, settings.qos)
        self._owned.append(gate.destroy)
        return gate

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        """Take a change that needs no new configuration, whole or not at all."""
        settings = changed(read(self, DriverSettings), parameters)
        try:
            adjust({name: pad.conditioned for name, pad in self._pads.items()},
                   {name: pad.layout.value.unit for name, pad in self._pads.items()}, settings)
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        if self._source is not None:
            self._source.adjust(settings.drop_incomplete, settings.heartbeat_timeout)
        return SetParametersResult(successful=True)

    def _publish(self, pad: str, frame: TaxelFrame) -> None:
        if self._gate is not None:
            self._gate.wait(pad, frame.sequence)
        publisher, layout, frame_id, conditioned = self._pads[pad]
        frame = conditioned.feed(frame)
        publisher.publish(taxel_array_message(frame, layout.pitch, layout.value.unit, frame_id))

    def _tare_limit(self, units: Mapping[str, str]) -> Callable[[str], float]:
        """The limit of a pad, by its name, whenever it is asked for."""
        return lambda pad: tare_limit(self.get_parameter('tare_limit').value, units[pad])

    def _faults(self) -> dict[str, FaultyTaxels]:
        return {name: pad.conditioned.faults for name, pad in self._pads.items()}

    def _publish_state(self) -> None:
        source, conditions = self._source, {name: pad.conditioned.condition for name, pad in self._pads.items()}
        if source is None:
            failure = None if self._error is None else failure_of(self._error)
            counts, health = BusStatistics({}, {}), BusHealth(failure, is_active=False)
            message = unconfigured(self.get_name(), health)
        else:
            counts, health = source.statistics(), source.health()
            message = self._findings.message(counts, health, conditions)
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)
        self._status.publish(status_message(message, counts, health, conditions))

    def _release(self) -> None:
        self._source = None
        while self._owned:
            self._owned.pop()()
        self._gate, self._pads = None, {}


def _failed(transition: str) -> DeviceError:
    return DeviceError('skin driver', expected=f'to {transition}', got='an unforeseen error',
                       remedy='The log above has it.')


def _pads(settings: DriverSettings) -> tuple[PadSettings, ...]:
    if not settings.pads:
        raise ConfigurationError('parameter pads', expected='a name for each pad', got='none', remedy='Name a pad.')
    pads = make_pads(settings.layouts, settings.node_ids, settings.pads)
    return pads if settings.replay else with_dictionaries(pads, settings.eds)  # a log needs none


def main() -> int:
    return run_node(DriverNode, DriverNode.autostart)


if __name__ == '__main__':
    sys.exit(main())
