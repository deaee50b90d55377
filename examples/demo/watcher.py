"""Node that watches the demo and pairs taxels with shapes, for the screen and the table."""

import time
from collections import OrderedDict
from collections.abc import Callable
from functools import partial

import numpy as np
from rclpy.node import Node

from examples.demo.observation import SeenFit, SeenFrame
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.ros.contact_messages import taxel_values
from tactile_node.ros.message_checks import check_contact_shape, check_taxel_array
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.time_messages import seconds
from tactile_node.shape.recognition import Shape, UnknownReason
from tactile_node.viewing.terminal import PadView
from tactile_skin.msg import ContactShape, TaxelArray

KEPT = 50  #: queue depth, and number of taxel arrays that may wait for their shapes (2.5 s)


class Watcher(Node):
    """Subscribes to the topics `taxels` and `shape` of each pad.

    ``demo_time`` converts an acquisition stamp to the script's time [s].
    """

    def __init__(self, pads: tuple[str, ...], demo_time: Callable[[float], float], full_scale: float, **options):
        super().__init__('demo_watcher', **options)
        self._demo_time, self._full_scale = demo_time, full_scale
        self._waiting: dict[str, OrderedDict[int, np.ndarray]] = {pad: OrderedDict() for pad in pads}
        self.seen: dict[str, list[SeenFrame]] = {pad: [] for pad in pads}
        #: times from SYNC to the arrival of each shape in this node, during the script [s]
        self.latency: list[float] = []
        self.incomplete = 0  #: number of taxel arrays with missing CAN frames
        qos = frames_qos(KEPT)
        for pad in pads:
            GuardedSubscription(self, TaxelArray, f'{pad}/taxels', partial(self._taxels, pad), qos,
                                check=check_taxel_array)
            GuardedSubscription(self, ContactShape, f'{pad}/shape', partial(self._shape, pad), qos,
                                check=check_contact_shape)

    def views(self) -> list[PadView]:
        """Return the current views of all pads that have data."""
        return [PadView(pad, seen[-1].taxels / self._full_scale, _words(seen[-1]))
                for pad, seen in self.seen.items() if seen]

    @property
    def is_empty(self) -> bool:
        """True if the latest shape of every pad says that nothing touches the pad."""
        return all(seen and seen[-1].name == Shape.NONE.value for seen in self.seen.values())

    @property
    def reached(self) -> float:
        """Script time up to which the shapes of all pads have arrived [s]."""
        return min(seen[-1].time if seen else 0.0 for seen in self.seen.values())

    def _taxels(self, pad: str, message: TaxelArray) -> None:
        waiting = self._waiting[pad]
        waiting[message.sequence] = taxel_values(message)
        self.incomplete += message.missing_can_frames > 0
        if len(waiting) > KEPT:
            waiting.popitem(last=False)

    def _shape(self, pad: str, message: ContactShape) -> None:
        taxels = self._waiting[pad].pop(message.sequence, None)
        stamp = seconds(message.header.stamp)
        demo_time = self._demo_time(stamp)
        if demo_time >= 0:
            self.latency.append(time.time() - stamp)
        if taxels is not None:
            names = dict(zip(message.class_names, map(float, message.probabilities)))
            self.seen[pad].append(SeenFrame(demo_time, names, np.array(taxels), _fit(message),
                                            UnknownReason(message.unknown_reason)))


def _fit(message: ContactShape) -> SeenFit | None:
    if not message.fit_valid:
        return None
    pose, names = message.pose.pose, tuple(message.parameter_names)
    angle = 2 * float(np.arctan2(pose.orientation.z, pose.orientation.w)) if 'angle' in names else None
    return SeenFit(dict(zip(message.dimension_names, message.dimensions)), (pose.position.x, pose.position.y), angle,
                   names, np.array(message.covariance).reshape(2 * [len(names)]),
                   np.array([(point.x, point.y) for point in message.outline.points]))


def _words(seen: SeenFrame) -> str:
    name = seen.name
    about = '' if seen.fit is None else f' {seen.fit.lengths} mm'
    if name == Shape.UNKNOWN.value:
        about = f' ({seen.reason.name.lower().replace("_", " ")})'
    return f'{name.replace("_", " ")} {seen.probabilities[name]:.0%}{about}'
