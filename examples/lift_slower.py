"""Lift more slowly after an event: a speed for the arm, by the events of both pads and the latest grasp.

    limit = LiftSpeed(node, ('left', 'right'))
    arm.lift(limit.speed())        # as often as you like [m/s]

No event never means that nothing slips (docs/events.md): it starts at half of the full speed where a slide along the
pad's y axis would not show, and stops where the grasp is not current or a pad has lost its contact.
"""

import time
from collections.abc import Callable

from rclpy.qos import QoSProfile

from tactile_node.grasp.trust import MAX_AGE
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.message_age import InputAge
from tactile_node.ros.motion_messages import check_contact_event, is_moving
from tactile_skin.msg import ContactEvent, ContactMotion, Grasp

FULL, LEAST = 0.1, 0.01  # m/s
CALM = 2.0               # s without an event, after which it is twice as fast again
SLOWS = (ContactEvent.SLIDING, ContactEvent.TURNING, ContactEvent.LIGHTER)


class LiftSpeed:
    """Halves the speed at each event, and doubles it again in each CALM."""

    def __init__(self, node, pads: tuple[str, str], steady: Callable[[], float] = time.monotonic):
        self._steady, self._speed, self._since = steady, FULL, steady()
        self._ages, self._grasp, self._arrival = InputAge(steady=steady), None, None
        node.create_subscription(Grasp, 'grasp', self.on_grasp, QoSProfile(depth=1))
        for pad in pads:
            node.create_subscription(ContactEvent, f'{pad}/events', self.on_event, QoSProfile(depth=10))

    def on_event(self, event: ContactEvent) -> None:
        """Slow down, however old the event is: that is the safe side."""
        if check_contact_event(event) is None and event.kind in SLOWS:
            self._speed, self._since = max(self._speed / 2, LEAST), self._steady()

    def on_grasp(self, grasp: Grasp) -> None:
        if check_grasp(grasp) is None:  # a malformed message is no information
            self._grasp, self._arrival = grasp, self._ages.arrived(grasp)
            if any(map(is_moving, grasp.motions)):  # also where its event was lost on the way
                self._speed, self._since = min(self._speed, FULL / 2), self._steady()

    def speed(self) -> float:
        """Return how fast to lift now [m/s]; 0: do not."""
        now = self._steady()
        if self._arrival is None or self._arrival.age(now) > MAX_AGE or self._grasp.contact != Grasp.TWO_SIDED:
            return 0.0
        if now - self._since > CALM:
            self._speed, self._since = min(2 * self._speed, FULL), now
        is_seen = any(motion.observable & ContactMotion.ALONG_Y for motion in self._grasp.motions)
        return self._speed if is_seen else min(self._speed, FULL / 2)
