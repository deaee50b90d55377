"""Lift more slowly after an event, given the events of both pads and the latest grasp.

    limit = LiftSpeed(node, ('left', 'right'))
    arm.lift(limit.speed())        # as often as you like [m/s]

Even without events, the object may slip (docs/events.md). If a slide along the pads' y axis cannot be observed, the arm
lifts at no more than half the full speed. The arm stops if the grasp is too old or a pad has lost its contact.

A lift shifts the object in the elastic skin, although nothing slides. During a shift, the arm lifts at no more than
half the full speed. A slide halves the speed, and `has_slid` tells the planner that the object has slid.
"""

import time
from collections.abc import Callable

from rclpy.qos import QoSProfile

from tactile_node.grasp.trust import MAX_AGE
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.message_age import InputAge
from tactile_node.ros.motion_messages import check_contact_event, is_moving
from tactile_skin.msg import ContactEvent, ContactMotion, Grasp

FULL = 0.1    # full speed [m/s]
LEAST = 0.01  # lowest speed after events [m/s]
CALM = 2.0    # time without events after which the speed doubles [s]
SLOWS = (ContactEvent.SLIDING, ContactEvent.TURNING, ContactEvent.LIGHTER)


class LiftSpeed:
    """Halves the lifting speed at each event, and doubles the speed after each period CALM without an event."""

    def __init__(self, node, pads: tuple[str, str], steady: Callable[[], float] = time.monotonic):
        self._steady, self._speed, self._since = steady, FULL, steady()
        self.has_slid = False  # True once the object has slid on a pad
        self._ages, self._grasp, self._arrival = InputAge(steady=steady), None, None
        node.create_subscription(Grasp, 'grasp', self.on_grasp, QoSProfile(depth=1))
        for pad in pads:
            node.create_subscription(ContactEvent, f'{pad}/events', self.on_event, QoSProfile(depth=10))

    def on_event(self, event: ContactEvent) -> None:
        """Slow down even if the event is old, because slowing down is always safe."""
        if check_contact_event(event) is None and event.kind in SLOWS:
            self.has_slid |= event.kind == ContactEvent.SLIDING
            self._speed, self._since = max(self._speed / 2, LEAST), self._steady()

    def on_grasp(self, grasp: Grasp) -> None:
        if check_grasp(grasp) is None:  # ignore malformed messages
            self._grasp, self._arrival = grasp, self._ages.arrived(grasp)
            self.has_slid |= any(motion.moving & ContactMotion.SLIDING for motion in grasp.motions)
            if any(map(is_moving, grasp.motions)):  # slow down even if the event message was lost
                self._speed, self._since = min(self._speed, FULL / 2), self._steady()

    def speed(self) -> float:
        """Return the current speed for lifting [m/s], or 0 to stop."""
        now = self._steady()
        if self._arrival is None or self._arrival.age(now) > MAX_AGE or self._grasp.contact != Grasp.TWO_SIDED:
            return 0.0
        if now - self._since > CALM:
            self._speed, self._since = min(2 * self._speed, FULL), now
        is_seen = any(motion.observable & ContactMotion.ALONG_Y for motion in self._grasp.motions)
        return self._speed if is_seen else min(self._speed, FULL / 2)
