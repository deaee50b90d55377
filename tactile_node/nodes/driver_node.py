"""The skin driver: a lifecycle node around one CAN bus, or a recorded log in its place.

configure = open the bus, check identities, write the configuration; activate = NMT start;
deactivate = pre-operational; cleanup = close.
"""

import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from tactile_node.conditioning.limits import tare_limit
from tactile_node.conditioning.taxel_faults import FaultyTaxels
from tactile_node.errors import BusError, ConfigurationError, DeviceAbsentError
from tactile_node.frames.frame_source import FrameSource
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.driver_source import driver_pads, make_source
from tactile_node.nodes.fault_service import FaultService
from tactile_node.nodes.health_timer import start_health_timer
from tactile_node.nodes.lifecycle_steps import LifecycleSteps
from tactile_node.nodes.pad_output import PadOutput
from tactile_node.nodes.replay_gate import ReplayGate
from tactile_node.nodes.run import run_node
from tactile_node.nodes.state_publisher import StatePublisher
from tactile_node.nodes.tare_service import TareService, Zeroing
from tactile_node.ros.conditioning_setup import adjust, conditioned_pads
from tactile_node.ros.lifecycle import reject_invalid_transitions
from tactile_node.ros.parameters import changed, declare, read
from tactile_node.ros.rosout_handler import forward_logs_to, stop_forwarding_to
from tactile_node.ros.settings import DriverSettings
from tactile_node.skin.pads import one_for_each

RETRY_PERIOD = 0.5  # s between two attempts to configure while the driver waits at start


class DriverNode(LifecycleNode):
    """Publishes `<pad>/taxels` for each pad while active, /diagnostics and `~/status` always."""

    def __init__(self, **options: Any):
        super().__init__(NODE_NAMES[Role.DRIVER], **options)
        reject_invalid_transitions(self)
        declare(self, DriverSettings)
        self.add_on_set_parameters_callback(self._on_parameters)
        self._source: FrameSource | None = None
        self._pads: dict[str, PadOutput] = {}
        self._gate: ReplayGate | None = None
        self._owned: list[Callable[[], object]] = []  # releases all that configure has made, last first
        self._steps = LifecycleSteps(self)
        self._tare = TareService(self)
        self._state = StatePublisher(self)
        start_health_timer(self, self._publish_state)
        forward_logs_to(self)

    def autostart(self, stop_requested: threading.Event | None = None) -> None:
        """Configure and activate where the parameter `autostart` is true. Raises the error of a failed transition.

        With `wait_at_start` it waits for a missing bus or device until ``stop_requested`` is set.
        """
        if not self.get_parameter('autostart').value:
            return
        stop = stop_requested if self.get_parameter('wait_at_start').value else None
        try:
            with nullcontext() if stop is None else self._steps.waiting():
                while self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
                    if stop is None or not isinstance(self._steps.error, (BusError, DeviceAbsentError)):
                        raise self._steps.failure('configure')
                    if stop.wait(RETRY_PERIOD):
                        return
        except RuntimeError:  # RCLError: a lifecycle manager has configured the node meanwhile
            return
        if self.trigger_activate() != TransitionCallbackReturn.SUCCESS:
            raise self._steps.failure('activate')

    @property
    def source(self) -> FrameSource | None:
        """The bus or the log, None while unconfigured."""
        return self._source

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        result = self._steps.attempt(self._configure)
        if result != TransitionCallbackReturn.SUCCESS:
            self._release()
        return self._publish_after(result)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._publish_after(self._steps.attempt(self._start))

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._tare.give_up('one that was deactivated')
        return self._publish_after(self._steps.attempt(self._configured_source().stop))

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._release()
        return self._publish_after(TransitionCallbackReturn.SUCCESS)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._release()
        return self._publish_after(TransitionCallbackReturn.SUCCESS)

    def destroy_node(self) -> None:
        self._release()
        if self.context.ok():
            self._publish_state()
        stop_forwarding_to(self)
        super().destroy_node()

    def _configure(self) -> None:
        settings = read(self, DriverSettings)
        pads = driver_pads(settings)
        frame_ids = one_for_each('frame_ids', settings.frame_ids, pads)
        conditioned = conditioned_pads(pads, settings)
        outputs = {}
        for pad, frame_id in zip(pads, frame_ids):
            outputs[pad.name] = output = PadOutput(self, pad, frame_id, conditioned[pad.name], qos=settings.qos)
            self._owned.append(output.destroy)
        self._pads = outputs  # all at once: at start the executor publishes the state of these meanwhile
        saving = FaultService(self, settings.faulty_taxels_file, self._faults)
        self._state.begin(f'{settings.interface} {settings.channel}')
        self._gate = self._make_gate(settings)
        source = make_source(settings, pads, self._publish)
        self._tare.begin(Zeroing(pads={name: pad.tared for name, pad in conditioned.items()},
                                 limit=self._tare_limit({pad.name: pad.layout.value.unit for pad in pads}),
                                 frame_period=settings.sync_period, auto_zero=source.auto_zero, boots=source.boots))
        self._owned += [saving.destroy, self._tare.end, source.close]
        source.open()
        self._source = source
        source.configure()

    def _start(self) -> None:
        self._configured_source().start()
        self._tare.expect()

    def _configured_source(self) -> FrameSource:
        if self._source is None:
            raise RuntimeError('the driver is not configured')
        return self._source

    def _make_gate(self, settings: DriverSettings) -> ReplayGate | None:
        """Only a log played as fast as possible needs one, and only where nothing may be lost."""
        if not settings.replay or settings.replay_pace or not settings.lossless:
            return None
        gate = ReplayGate(self, settings.pads, settings.qos)
        self._owned.append(gate.destroy)
        return gate

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        """Apply a change that needs no new configuration, as a whole or not at all."""
        settings = changed(read(self, DriverSettings), parameters)
        try:
            adjust({name: pad.conditioned for name, pad in self._pads.items()},
                   {name: pad.unit for name, pad in self._pads.items()}, settings)
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        if self._source is not None:
            self._source.adjust(settings.drop_incomplete, settings.heartbeat_timeout)
        return SetParametersResult(successful=True)

    def _publish(self, pad: str, frame: TaxelFrame) -> None:
        if self._gate is not None:
            self._gate.wait(pad, frame.sequence)
        self._pads[pad].publish(frame)

    def _tare_limit(self, units: Mapping[str, str]) -> Callable[[str], float]:
        """Return what gives the limit of a pad, by its name, at the time of the call."""
        return lambda pad: tare_limit(self.get_parameter('tare_limit').value, units[pad])

    def _faults(self) -> dict[str, FaultyTaxels]:
        return {name: pad.conditioned.faults for name, pad in self._pads.items()}

    def _publish_state(self) -> None:
        self._state.publish(self._source, self._steps.error,
                            {name: pad.conditioned.condition for name, pad in self._pads.items()})

    def _publish_after(self, result: TransitionCallbackReturn) -> TransitionCallbackReturn:
        """Publish the state after a transition and return the transition's result."""
        self._publish_state()
        return result

    def _release(self) -> None:
        self._source = None
        while self._owned:
            self._owned.pop()()
        self._gate = None
        self._pads = {}


def main() -> int:
    return run_node(DriverNode, DriverNode.autostart)


if __name__ == '__main__':
    sys.exit(main())
