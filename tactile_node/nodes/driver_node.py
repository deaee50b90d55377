"""The skin driver: a lifecycle node around one CAN bus, or a recorded log in its place.

configure = open the bus, check identities, write the configuration; activate = NMT start;
deactivate = pre-operational; cleanup = close.
"""

import logging
import sys
import threading
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from tactile_node.assembly.frame_source import FrameSource
from tactile_node.conditioning.tare import tare_limit
from tactile_node.errors import BusError, ConfigurationError, DeviceAbsentError
from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.driver_services import TareService, Zeroing, serve_faults
from tactile_node.nodes.driver_source import check_heartbeat, driver_pads, make_source, pad_frames
from tactile_node.nodes.hand_over import HandOver
from tactile_node.nodes.lifecycle_steps import LifecycleSteps, reject_invalid_transitions
from tactile_node.nodes.pad_output import PadOutput
from tactile_node.nodes.replay import ClockOutput
from tactile_node.nodes.run import run_node
from tactile_node.nodes.state_publisher import DriverState, StatePublisher
from tactile_node.ros.conditioning_setup import adjust, conditioned_pads, masks_faulty, skin_responses
from tactile_node.ros.parameters import declare, follow_changes, read, table
from tactile_node.ros.rosout_handler import forward_logs_to, stop_forwarding_to
from tactile_node.ros.settings import DriverSettings
from tactile_node.ros.status_message import PrimaryState

#: All that is not live; autostart and wait_at_start are read once, before that.
READ_AT_CONFIGURE = frozenset(each.name for each in table(DriverSettings) if not each.properties.live
                              and each.name not in ('autostart', 'wait_at_start'))
logger = logging.getLogger(__name__)

WAITED_FOR = (BusError, DeviceAbsentError)
LAST_ANSWER = 0.3  # s in which the answer to the transition `shutdown` is sent before the process ends
RETRY_PERIOD = 0.5  # s between two attempts to configure while the driver waits at start


class DriverNode(LifecycleNode):
    """Publishes `<pad>/taxels` for each pad while active, /diagnostics and `~/status` always.

    ``hand_over``: to the nodes of this process.
    """

    _is_made = False  # True after the constructor

    def __init__(self, hand_over: HandOver | None = None, **options: Any):
        super().__init__(NODE_NAMES[Role.DRIVER], **options)
        reject_invalid_transitions(self)
        declare(self, DriverSettings, READ_AT_CONFIGURE)
        follow_changes(self, DriverSettings, self._check, self._apply)
        self.add_on_set_parameters_callback(self._refuse_fixed)  # rclpy asks the last one first
        self._settings: DriverSettings | None = None  # as configure has read them
        self.source: FrameSource | None = None  #: the bus or the log, None while unconfigured
        self._pads: dict[str, PadOutput] = {}
        self._hand_over = hand_over or HandOver()
        self._owned: list[Callable[[], object]] = []  # releases all that configure has made, last first
        self._steps = LifecycleSteps(self)
        self._stop_requested: threading.Event | None = None
        self._tare = TareService(self)
        self._lifecycle = PrimaryState.UNCONFIGURED
        self._state = StatePublisher(self, self._driver_state)
        forward_logs_to(self)
        self._is_made = True

    def autostart(self, stop_requested: threading.Event | None = None) -> None:
        """Configure and activate where the parameter `autostart` is true. Raises the error of a failed transition.

        With `wait_at_start` it waits for a missing bus or device until ``stop_requested`` is set. The node sets this
        event itself once it is finalized: nothing can be done with it any more, so its process ends.
        """
        self._stop_requested = stop_requested
        if not self.get_parameter('autostart').value:
            return
        stop = stop_requested if self.get_parameter('wait_at_start').value else None
        with self._steps.autostart(waits_for=() if stop is None else WAITED_FOR):
            if self._is_configured_at_start(stop) and self.trigger_activate() != TransitionCallbackReturn.SUCCESS:
                raise self._steps.failure('activate')

    def _is_configured_at_start(self, stop: threading.Event | None) -> bool:
        """Configure, repeatedly while ``stop`` is given and not set; False where it is set or a manager was faster."""
        try:
            while self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
                if self._lifecycle != PrimaryState.UNCONFIGURED:  # the same in Kilted, which raises no error
                    return False
                if stop is None or not isinstance(self._steps.error, WAITED_FOR):
                    raise self._steps.failure('configure')
                if stop.wait(RETRY_PERIOD):
                    return False
        except RuntimeError:  # RCLError of Jazzy: a lifecycle manager has configured the node meanwhile
            return False
        return True

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        result = self._steps.attempt(self._configure)
        if result != TransitionCallbackReturn.SUCCESS:
            self._release()
        return self._publish_after(result, PrimaryState.INACTIVE)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._publish_after(self._steps.attempt(self._start), PrimaryState.ACTIVE)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._tare.give_up('one that was deactivated')
        self._hand_over.release()
        return self._publish_after(self._steps.attempt(self._configured_source().stop), PrimaryState.INACTIVE)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._release()
        return self._publish_after(TransitionCallbackReturn.SUCCESS, PrimaryState.UNCONFIGURED)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._release()
        if self._stop_requested is not None:
            self.get_logger().info('The driver is finalized: its process ends.')
            threading.Timer(LAST_ANSWER, self._stop_requested.set).start()
        return self._publish_after(TransitionCallbackReturn.SUCCESS, PrimaryState.FINALIZED)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._release()
        return self._publish_after(TransitionCallbackReturn.SUCCESS, PrimaryState.UNCONFIGURED)

    def destroy_node(self) -> None:
        if self._is_made:  # since Kilted, the context destroys a node whose constructor has failed, too
            self._release()
            if self.context.ok():
                self._state.update(is_last=True)
            stop_forwarding_to(self)
        super().destroy_node()

    def _configure(self) -> None:
        self._settings = settings = read(self, DriverSettings)
        pads = driver_pads(settings)
        responses = skin_responses(pads, settings)
        conditioned = conditioned_pads(pads, settings, responses)
        frame_period = max(pad.layout.frame_period(settings.sync_period) for pad in pads)
        self._state.begin(f'{settings.interface} {settings.channel}', frame_period)
        source = make_source(settings, pads, lambda pad, frame: self._pads[pad].publish(frame),
                             self._make_clock(settings))
        outputs = {}
        for pad, frame_id in zip(pads, pad_frames(settings, pads)):
            outputs[pad.name] = output = PadOutput(
                self, pad, frame_id, conditioned[pad.name], settings, self._hand_over, source.age,
                layer=responses[pad.name].layer if pad.name in responses else None)
            self._owned.append(output.destroy)
            if settings.replay and settings.lossless and not output.is_answered:
                raise _not_answered(pad.name)
        self._pads = outputs  # all at once: at start the executor publishes the state of these meanwhile
        saving = serve_faults(self, settings.faulty_taxels_file,
                              lambda: {name: pad.conditioned.faults for name, pad in self._pads.items()})
        units = {pad.name: pad.layout.value.unit for pad in pads}
        self._tare.begin(Zeroing(pads={name: pad.tared for name, pad in conditioned.items()},
                                 limit=lambda pad: tare_limit(self.get_parameter('tare_limit').value, units[pad]),
                                 frame_period=frame_period, source=source))
        self._owned += [lambda: self.destroy_service(saving), self._tare.end, source.close, self._hand_over.release]
        source.open()
        self.source = source
        self._apply(read(self, DriverSettings))  # live ones may have been set since they were read
        source.configure()

    def _start(self) -> None:
        self._hand_over.hold()
        self._configured_source().start()
        self._tare.expect()

    def _configured_source(self) -> FrameSource:
        if self.source is None:
            raise RuntimeError('the driver is not configured')
        return self.source

    def _make_clock(self, settings: DriverSettings) -> Callable[[float], None] | None:
        """Return what shows the time of a log on /clock, where that is wanted. Raises ConfigurationError for a bus."""
        if not settings.publish_clock:
            return None
        if not settings.replay:
            raise ConfigurationError('parameter publish_clock', expected='a log whose time is published (replay)',
                                     got='a live bus', remedy='Leave it false, or name a log.')
        clock = ClockOutput(self)
        self._owned.append(clock.destroy)
        return clock.show

    def _refuse_fixed(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse to change what configure has read: it stays until cleanup."""
        fixed = [each.name for each in parameters if each.name in READ_AT_CONFIGURE]
        if self._settings is not None and fixed:
            return SetParametersResult(successful=False, reason=f'{", ".join(fixed)}: read at configure. Clean up the '
                                       'driver (ros2 lifecycle set), set it and configure again.')
        return SetParametersResult(successful=True)

    def _check(self, settings: DriverSettings) -> None:
        """Raise ConfigurationError for live settings that cannot be applied."""
        masks_faulty(settings.faulty_taxels)
        if self._settings is not None:  # else heartbeat_period may still change, and configure checks both
            check_heartbeat(settings)

    def _apply(self, settings: DriverSettings) -> None:
        """Apply the live settings."""
        adjust({name: pad.conditioned for name, pad in self._pads.items()},
               {name: pad.unit for name, pad in self._pads.items()}, settings)
        if self.source is not None:
            self.source.adjust(settings.drop_incomplete, settings.heartbeat_timeout)

    def _driver_state(self) -> DriverState:
        return DriverState(self._lifecycle, self.source, self._steps.error,
                           {name: pad.condition for name, pad in self._pads.items()})

    def _publish_after(self, result: TransitionCallbackReturn, goal: PrimaryState) -> TransitionCallbackReturn:
        """Publish the state after a transition, to ``goal`` if it succeeds, and return the transition's result."""
        if result == TransitionCallbackReturn.SUCCESS:
            self.get_logger().info(f'Lifecycle: {self._lifecycle.name.lower()} -> {goal.name.lower()}.')
            self._lifecycle = goal
        try:
            self._state.update()
        except Exception:  # what cannot be reported must not fail the transition: the driver works
            logger.exception('The state of the driver could not be published.')
        return result

    def _release(self) -> None:
        self._settings = None
        self.source = None
        while self._owned:
            self._owned.pop()()
        self._pads = {}


def _not_answered(pad: str) -> ConfigurationError:
    return ConfigurationError(
        'parameters replay and lossless', expected='the processor and the classifier of each pad in the process of the '
        'driver: the log waits for their answers', got=f'none of pad {pad!r}, or a topic between them that is remapped',
        remedy='Start all with `tactile bringup --replay`, or set lossless false.')


def main() -> int:
    return run_node(DriverNode, DriverNode.autostart)


if __name__ == '__main__':
    sys.exit(main())
