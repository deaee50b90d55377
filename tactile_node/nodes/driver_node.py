"""The skin driver is a lifecycle node that reads one CAN bus, or replays a recorded log instead.

The configure transition opens the bus, checks the identity of the devices and configures them. The activate transition
sends NMT start to the devices and starts sending SYNC. The deactivate transition sets the devices to PRE-OPERATIONAL.
The cleanup transition closes the bus.
"""

import logging
import sys
import threading
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from tactile_node.assembly.facts import BusFacts
from tactile_node.assembly.fault_text import failure_of
from tactile_node.conditioning.tare import tare_limit
from tactile_node.errors import BusError, ConfigurationError, DeviceAbsentError
from tactile_node.node_graph import Role
from tactile_node.nodes.driver_services import TareService, Zeroing, serve_faults
from tactile_node.nodes.driver_source import check_heartbeat, driver_pads, make_source, pad_frames
from tactile_node.nodes.lifecycle_steps import LifecycleSteps, reject_invalid_transitions
from tactile_node.nodes.pad_output import PadOutput
from tactile_node.nodes.replay import ClockOutput
from tactile_node.nodes.run import run_node
from tactile_node.nodes.stage import Stages
from tactile_node.nodes.stage_node import StageNode
from tactile_node.nodes.state_publisher import DriverState, StatePublisher
from tactile_node.ros.conditioning_setup import adjust, conditioned_pads, masks_faulty, skin_responses
from tactile_node.ros.parameters import declare, follow_changes, read, table
from tactile_node.ros.rosout_handler import forward_logs_to, stop_forwarding_to
from tactile_node.ros.settings import DriverSettings
from tactile_node.ros.status_message import PrimaryState
from tactile_node.sources.frame_source import FrameSource
from tactile_node.taxel_frame import TaxelFrame

#: Parameters read by configure: all parameters that are not live, except autostart and wait_at_start (read at startup).
READ_AT_CONFIGURE = frozenset(each.name for each in table(DriverSettings) if not each.properties.live
                              and each.name not in ('autostart', 'wait_at_start'))
logger = logging.getLogger(__name__)

#: Errors after which the driver tries to configure again, if the parameter wait_at_start is true.
WAITED_FOR = (BusError, DeviceAbsentError)
#: Delay between the `shutdown` transition and the end of the process, during which rclpy sends the response [s].
LAST_ANSWER = 0.3
#: Time after which a log that waits for the chain checks whether the driver was deactivated [s].
WAITING_PERIOD = 0.2
RETRY_PERIOD = 0.5  #: Time between two attempts to configure while the driver waits for a bus or device at start [s].


class DriverNode(StageNode, LifecycleNode):
    """Publishes `<pad>/taxels` for each pad while active, and /diagnostics and `~/status` in every lifecycle state.

    The arguments are those of `StageNode`.
    """

    _is_made = False  # True once the constructor has finished

    def __init__(self, stages: Stages | None = None, **options: Any):
        super().__init__(Role.DRIVER, stages, **options)
        reject_invalid_transitions(self)
        declare(self, DriverSettings, READ_AT_CONFIGURE)
        follow_changes(self, DriverSettings, self._check, lambda _: self._stages.chain.post(self._apply))
        # added last, because rclpy calls the last added callback first
        self.add_on_set_parameters_callback(self._refuse_fixed)
        self._settings: DriverSettings | None = None  # None unless configured
        self.source: FrameSource | None = None  #: the bus or the log, or None while the driver is unconfigured
        self._pads: dict[str, PadOutput] = {}
        self._is_playing = False  # True while the thread of a log may wait for the chain
        # functions that release the resources acquired by configure, called in reverse order
        self._owned: list[Callable[[], object]] = []
        self._steps = LifecycleSteps(self)
        self._stop_requested: threading.Event | None = None
        self._tare = TareService(self)
        self._lifecycle = PrimaryState.UNCONFIGURED
        self._state = StatePublisher(self, self._driver_state)
        forward_logs_to(self)
        self._is_made = True

    def autostart(self, stop_requested: threading.Event | None = None) -> None:
        """Configure and activate the node if the parameter `autostart` is true.

        With the parameter `wait_at_start`, the node waits for a missing bus or device until ``stop_requested`` is set.

        Parameters
        ----------
        stop_requested : threading.Event or None
            Event that ends the process. The node itself sets the event when it is finalized, because a finalized node
            can never be used again.

        Raises
        ------
        TactileError
            Raised if a transition fails.
        """
        self._stop_requested = stop_requested
        if not self.get_parameter('autostart').value:
            return
        stop = stop_requested if self.get_parameter('wait_at_start').value else None
        with self._steps.autostart(waits_for=() if stop is None else WAITED_FOR):
            if self._is_configured_at_start(stop) and self.trigger_activate() != TransitionCallbackReturn.SUCCESS:
                raise self._steps.failure('activate')

    def _is_configured_at_start(self, stop: threading.Event | None) -> bool:
        """Configure the node. If ``stop`` is given, repeat the attempt until it succeeds or ``stop`` is set.

        Returns False if ``stop`` was set, or if a lifecycle manager configured the node in the meantime.
        """
        try:
            while self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
                # a lifecycle manager has configured the node; on Kilted, rclpy raises no error for it
                if self._lifecycle != PrimaryState.UNCONFIGURED:
                    return False
                if stop is None or not isinstance(self._steps.error, WAITED_FOR):
                    raise self._steps.failure('configure')
                if stop.wait(RETRY_PERIOD):
                    return False
        except RuntimeError:  # a lifecycle manager has configured the node; on Jazzy, rclpy raises RCLError for it
            return False
        return True

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the bus or the log, and configure the devices."""
        result = self._steps.attempt(self._configure)
        if result != TransitionCallbackReturn.SUCCESS:
            self._release()
        return self._publish_after(result, PrimaryState.INACTIVE)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start the devices or the log."""
        return self._publish_after(self._steps.attempt(self._start), PrimaryState.ACTIVE)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the devices or the log."""
        self._tare.give_up('one that was deactivated')
        self._is_playing = False
        return self._publish_after(self._steps.attempt(self._configured_source().stop), PrimaryState.INACTIVE)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the bus or the log."""
        self._release()
        return self._publish_after(TransitionCallbackReturn.SUCCESS, PrimaryState.UNCONFIGURED)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the bus or the log, and end the process."""
        self._release()
        if self._stop_requested is not None:
            self.get_logger().info('The driver is finalized, so its process ends now.')
            threading.Timer(LAST_ANSWER, self._stop_requested.set).start()
        return self._publish_after(TransitionCallbackReturn.SUCCESS, PrimaryState.FINALIZED)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the bus or the log after an error in a transition."""
        self._release()
        return self._publish_after(TransitionCallbackReturn.SUCCESS, PrimaryState.UNCONFIGURED)

    def destroy_node(self) -> None:
        """Close the bus or the log, and publish the state of the driver one last time."""
        if self._is_made:  # since Kilted, the context also destroys a node whose constructor failed
            self._release()
            self._state.end()
            stop_forwarding_to(self)
        super().destroy_node()

    def _configure(self) -> None:
        self._settings = settings = read(self, DriverSettings)
        pads = driver_pads(settings)
        responses = skin_responses(pads, settings)
        conditioned = conditioned_pads(pads, settings, responses)
        frame_period = max(pad.layout.frame_period(settings.sync_period) for pad in pads)
        self._state.begin(f'{settings.interface} {settings.channel}', frame_period)
        source = make_source(settings, pads, self._send_logged if settings.replay else self._send,
                             self._stages.chain, self._make_clock(settings))
        outputs = {}
        for pad, frame_id in zip(pads, pad_frames(settings, pads)):
            outputs[pad.name] = output = PadOutput(
                self, pad, frame_id, conditioned[pad.name], settings, self._stages,
                layer=responses[pad.name].layer if pad.name in responses else None)
            self._owned.append(output.end)
            if settings.replay and settings.lossless and not self._stages.is_complete(output.topic):
                raise _not_answered(pad.name)
        self._pads = outputs  # replaced in one assignment, because the executor may publish the state at any time
        saving = serve_faults(self, settings.faulty_taxels_file,
                              lambda: {name: pad.conditioned.faults for name, pad in self._pads.items()})
        units = {pad.name: pad.layout.value.unit for pad in pads}
        self._tare.begin(Zeroing(pads={name: pad.tared for name, pad in conditioned.items()},
                                 limit=lambda pad: tare_limit(self.get_parameter('tare_limit').value, units[pad]),
                                 frame_period=frame_period, source=source))
        self._owned += [lambda: self.destroy_service(saving), self._tare.end, source.close]
        source.open()
        self.source = source
        self._stages.chain.post(self._apply)  # a live parameter may have been set after the settings were read above
        source.configure()

    def _send(self, pad: str, frame: TaxelFrame) -> None:
        """Send a taxel frame of a bus, on the chain thread."""
        self._pads[pad].send_frame(frame)

    def _send_logged(self, pad: str, frame: TaxelFrame) -> None:
        """Send a taxel frame of a log on the chain thread, while the thread of the log waits.

        A lossless log waits until all stages have processed the frame. Any other log waits only until the contacts are
        found. On a slow machine, newer contacts therefore overtake older ones, as with a live bus.

        An exception of `_send` is raised on the thread of the log, so that the router counts it as for a bus.
        """
        chain, is_lossless = self._stages.chain, self._settings is not None and self._settings.lossless
        errors: list[Exception] = []

        def send() -> None:
            try:
                self._send(pad, frame)
            except Exception as error:
                if not self._is_playing:  # the thread of the log may no longer wait, so the chain logs the exception
                    raise
                errors.append(error)
        chain.post(send)
        while self._is_playing and not chain.wait_until_idle(WAITING_PERIOD, with_postponed=is_lossless):
            pass
        if errors:
            raise errors[0]

    def _start(self) -> None:
        self._is_playing = True
        self._configured_source().start()
        self._tare.expect()

    def _configured_source(self) -> FrameSource:
        if self.source is None:
            raise RuntimeError('the driver is not configured')
        return self.source

    def _make_clock(self, settings: DriverSettings) -> Callable[[float], object]:
        """Return the function that publishes the time of a log on /clock if publish_clock is true.

        Raises ConfigurationError if publish_clock is set for a live bus.
        """
        if not settings.publish_clock:
            return lambda stamp: None
        if not settings.replay:
            raise ConfigurationError('parameter publish_clock', expected='a replayed log whose time can be published',
                                     got='a live bus', remedy='Set publish_clock to false, or replay a log.')
        clock = ClockOutput(self)
        self._owned.append(clock.destroy)
        return clock.show

    def _refuse_fixed(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse changes to parameters that were read by configure, because the driver uses them until cleanup."""
        fixed = [each.name for each in parameters if each.name in READ_AT_CONFIGURE]
        if self._settings is not None and fixed:
            return SetParametersResult(successful=False, reason=f'{", ".join(fixed)}: read at configure. Clean up the '
                                       'driver (ros2 lifecycle set), set the parameter and configure the driver again.')
        return SetParametersResult(successful=True)

    def _check(self, settings: DriverSettings) -> None:
        """Raise ConfigurationError if live settings cannot be applied."""
        masks_faulty(settings.faulty_taxels)
        if self._settings is not None:  # heartbeat_period may still change before configure
            check_heartbeat(settings)

    def _apply(self) -> None:
        """Apply the present live settings, on the chain thread."""
        settings, pads, source = read(self, DriverSettings), self._pads, self.source
        adjust({name: pad.conditioned for name, pad in pads.items()}, {name: pad.unit for name, pad in pads.items()},
               settings)
        if source is not None:
            source.adjust(settings.drop_incomplete, settings.heartbeat_timeout)

    def _driver_state(self) -> DriverState:
        source, error = self.source, self._steps.error
        if source is not None:
            facts = source.facts()
        else:
            facts = BusFacts(failure=None if error is None else failure_of(error), active=False)
        return DriverState(self._lifecycle, facts, {name: pad.condition for name, pad in self._pads.items()})

    def _publish_after(self, result: TransitionCallbackReturn, goal: PrimaryState) -> TransitionCallbackReturn:
        """Publish the driver's state after a transition to ``goal``, and return the ``result`` of the transition."""
        if result == TransitionCallbackReturn.SUCCESS:
            self.get_logger().info(f'Lifecycle: {self._lifecycle.name.lower()} -> {goal.name.lower()}.')
            self._lifecycle = goal
        try:
            self._state.update()
        # the driver itself works, so a state that cannot be published must not make the transition fail
        except Exception:
            logger.exception('The state of the driver could not be published.')
        return result

    def _release(self) -> None:
        self._settings = None
        self.source = None
        self._is_playing = False
        while self._owned:
            self._owned.pop()()
        self._pads = {}


def _not_answered(pad: str) -> ConfigurationError:
    return ConfigurationError(
        'parameters replay and lossless', expected='the processor and the classifier of each pad in the same process '
        'as the driver, because a lossless replay waits for their results',
        got=f'none for pad {pad!r}, or a remapped topic between them',
        remedy='Start all nodes with `tactile bringup --replay`, or set lossless to false.')


def main() -> int:
    """Run the node and return the exit code."""
    return run_node(DriverNode, DriverNode.autostart)


if __name__ == '__main__':
    sys.exit(main())
