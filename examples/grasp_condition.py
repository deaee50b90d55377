"""Condition for a py_trees behaviour tree that succeeds while the grasp is stable.

    node = rclpy.create_node('tree')
    watch = GraspWatch(node, 'grasp')
    root = py_trees.composites.Sequence('lift', memory=False, children=[
        IsGraspStable('is it held', watch, shapes=('square',), min_confidence=0.8), Lift()])

The condition fails as soon as the latest grasp is too old, for example because a node has ended or hangs. An old
message therefore never makes the condition succeed. Tick the tree in a timer of the same node, or in the thread that
spins the node.
"""

import time
from collections.abc import Callable, Collection
from math import inf

import py_trees
from rclpy.qos import QoSProfile

from tactile_node.grasp.trust import MAX_AGE, MAX_SILENCE, Doubt, doubt
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.message_age import Arrival, InputAge
from tactile_skin.msg import ContactShape, Grasp


class GraspWatch:
    """Keeps the latest usable grasp on a topic and its age. Several conditions may share one watch."""

    def __init__(self, node, topic: str = 'grasp', steady: Callable[[], float] = time.monotonic):
        self._steady = steady
        self._ages = InputAge(steady=steady)
        self._latest: tuple[Grasp, Arrival] | None = None
        # a depth of 1 keeps only the latest grasp
        node.create_subscription(Grasp, topic, self.receive, QoSProfile(depth=1))

    def receive(self, grasp: Grasp) -> None:
        if check_grasp(grasp) is None:  # ignore malformed messages
            self._latest = grasp, self._ages.arrived(grasp)

    def current(self) -> Grasp | None:
        """Return the latest grasp, or None if no grasp is recent enough to act on."""
        if self._latest is None:
            return None
        grasp, arrival = self._latest
        now = self._steady()
        is_current = now - arrival.steady <= MAX_SILENCE and arrival.age(now) <= MAX_AGE and grasp.fresh
        return grasp if is_current else None


class IsGraspStable(py_trees.behaviour.Behaviour):
    """Behaviour that returns SUCCESS while an object is held stably, and FAILURE otherwise.

    Parameters
    ----------
    name
        Name of the behaviour.
    watch
        Source of the latest grasp.
    shapes
        Names of the accepted shapes. An empty collection accepts any object.
    min_confidence
        Smallest accepted confidence in a known shape, from both faces together. If this value is above 0, an unknown
        shape is not accepted.
    """

    def __init__(self, name: str, watch: GraspWatch, shapes: Collection[str] = (), min_confidence: float = 0.0):
        super().__init__(name)
        self._watch, self._shapes, self._min_confidence = watch, frozenset(shapes), min_confidence

    def update(self) -> py_trees.common.Status:
        self.feedback_message = self._missing()
        return py_trees.common.Status.FAILURE if self.feedback_message else py_trees.common.Status.SUCCESS

    def _missing(self) -> str:
        """Return the first requirement that is not met, or an empty string if all are met."""
        grasp = self._watch.current()
        if grasp is None:
            return 'not known'
        # `current` has already checked the times
        if (found := doubt(grasp, silence=0.0, max_age=inf)) is not Doubt.NONE:
            return found.value
        if self._shapes and grasp.class_name not in self._shapes:
            return 'another shape'
        if self._min_confidence and (grasp.shape == ContactShape.UNKNOWN or grasp.confidence < self._min_confidence):
            return 'not sure'
        return ''
