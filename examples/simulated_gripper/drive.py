"""Motor and controller of the gripper, with realistic speed, limited force and delayed commands."""

from collections import deque
from dataclasses import dataclass, replace
from math import inf, isfinite

from examples.simulated_gripper.model import MAX_GAP
from tactile_node.errors import InputError

MAX_SPEED = 0.10    #: highest speed of the gap [m/s]
MAX_EFFORT = 20.0   #: highest force of a pad [N]
DELAY = 0.04                   #: delay from a command to its execution by the motor [s]
STIFFNESS = 2000.0  #: stiffness of a finger's position loop [N/m]
DAMPING = 25.0      #: damping of a finger's position loop [N s/m]
AT_GOAL = 0.0003    #: largest position error at which a finger has reached its goal [m]
AT_REST = 0.0005    #: highest speed at which a finger counts as at rest [m/s]
SETTLED = 0.1       #: time at rest after which a finger counts as settled [s]


@dataclass(frozen=True)
class Command:
    """Command with a goal for the gap [m], a speed of the gap [m/s], and the highest force of each pad [N]."""

    position: float
    velocity: float = 0.05
    effort: float = 2.0

    def __post_init__(self) -> None:
        for name, value, most in (('position', self.position, MAX_GAP), ('velocity', self.velocity, MAX_SPEED),
                                  ('effort', self.effort, MAX_EFFORT)):
            if not isfinite(value) or not 0 <= value <= most or not (value or name == 'position'):
                raise InputError(f'gripper command, {name}', expected=f'a number from 0 to {most}', got=f'{value}',
                                 remedy='Give values in m, m/s and N within the limits of the gripper.')


class Drive:
    """Position loop with limited force for two coupled fingers.

    Positions are half of the gap [m], and times are simulated times [s]. All forces refer to one finger. At rest,
    the force of a finger equals the force of its pad.
    """

    def __init__(self, gap: float = MAX_GAP):
        self._waiting: deque[tuple[float, Command | None]] = deque()
        self._command = Command(gap)
        self._setpoint = gap / 2
        self._still_since = inf
        self.is_stalled = False      #: True if the finger presses with the full allowed force and does not move
        self.is_at_goal = False

    def put(self, now: float, command: Command | None) -> None:
        """Execute ``command`` at ``now`` + DELAY. A ``command`` of None stops the finger in place."""
        self._waiting.append((now + DELAY, command))
        self.is_stalled = self.is_at_goal = False

    def force(self, now: float, step: float, position: float, speed: float) -> float:
        """Return the outward force of a finger during the next ``step`` [N]."""
        while self._waiting and self._waiting[0][0] <= now:
            self._begin(self._waiting.popleft()[1])
        goal, effort = self._command.position / 2, self._command.effort
        before, most = self._setpoint, self._command.velocity / 2 * step
        self._setpoint += min(max(goal - self._setpoint, -most), most)
        wanted = (self._setpoint - before) / step
        lead = effort / STIFFNESS  # largest lead of the setpoint ahead of a blocked finger [m]
        self._setpoint = min(max(self._setpoint, position - lead), position + lead)
        force = STIFFNESS * (self._setpoint - position) + DAMPING * (wanted - speed)
        self._judge(now, position - goal, speed, abs(force) >= 0.99 * effort)
        return min(max(force, -effort), effort)

    def _begin(self, command: Command | None) -> None:
        self._still_since = inf
        # freeze the setpoint, which is ahead of a pressing finger, so that the finger keeps pressing
        if command is None:
            command = replace(self._command, position=min(max(2 * self._setpoint, 0.0), MAX_GAP))
        self._command = command

    def _judge(self, now: float, error: float, speed: float, at_limit: bool) -> None:
        self._still_since = min(self._still_since, now) if abs(speed) < AT_REST else inf
        is_settled = now - self._still_since >= SETTLED and not self._waiting
        self.is_at_goal = is_settled and abs(error) < AT_GOAL
        self.is_stalled = is_settled and at_limit and not self.is_at_goal
