"""The gripper's motor and its controller: real closing speed, a limited force, and commands that arrive late."""

from collections import deque
from dataclasses import dataclass, replace
from math import inf, isfinite

from examples.simulated_gripper.model import MAX_GAP
from tactile_node.errors import InputError

MAX_SPEED, MAX_EFFORT = 0.10, 20.0  #: of the gap [m/s]; of a pad [N]
DELAY = 0.04                   #: from a command until the motor obeys [s]
STIFFNESS, DAMPING = 2000.0, 25.0   #: of a finger's position loop [N/m, N s/m]
AT_GOAL, AT_REST, SETTLED = 0.0003, 0.0005, 0.1  #: of a finger [m, m/s], and for so long [s]


@dataclass(frozen=True)
class Command:
    """Where the gap is to go [m], how fast [m/s] and with which force of each pad at most [N]."""

    position: float
    velocity: float = 0.05
    effort: float = 2.0

    def __post_init__(self) -> None:
        for name, value, most in (('position', self.position, MAX_GAP), ('velocity', self.velocity, MAX_SPEED),
                                  ('effort', self.effort, MAX_EFFORT)):
            if not isfinite(value) or not 0 <= value <= most or not (value or name == 'position'):
                raise InputError(f'gripper command, {name}', expected=f'a number from 0 to {most}', got=f'{value}',
                                 remedy='Give metres, metres a second and newtons that the gripper can do.')


class Drive:
    """A position loop with a limited force for two coupled fingers; positions are half of the gap [m].

    Times are those of the physics [s]. The force is that of each finger, so at rest that of each pad.
    """

    def __init__(self, gap: float = MAX_GAP):
        self._waiting: deque[tuple[float, Command | None]] = deque()
        self._command = Command(gap)
        self._setpoint = gap / 2
        self._still_since = inf
        self.is_stalled = False      #: it presses with all the force allowed and does not move
        self.is_at_goal = False

    def put(self, now: float, command: Command | None) -> None:
        """Obey ``command`` DELAY after ``now``; None: stop, and keep place and force."""
        self._waiting.append((now + DELAY, command))
        self.is_stalled = self.is_at_goal = False

    def force(self, now: float, step: float, position: float, speed: float) -> float:
        """Return the force of a finger [N], outward, for the next ``step`` [s]."""
        while self._waiting and self._waiting[0][0] <= now:
            self._obey(self._waiting.popleft()[1])
        goal, effort = self._command.position / 2, self._command.effort
        before, most = self._setpoint, self._command.velocity / 2 * step
        self._setpoint += min(max(goal - self._setpoint, -most), most)
        wanted = (self._setpoint - before) / step
        lead = effort / STIFFNESS  # the setpoint waits for a finger that is held up
        self._setpoint = min(max(self._setpoint, position - lead), position + lead)
        force = STIFFNESS * (self._setpoint - position) + DAMPING * (wanted - speed)
        self._judge(now, position - goal, speed, abs(force) >= 0.99 * effort)
        return min(max(force, -effort), effort)

    def _obey(self, command: Command | None) -> None:
        self._still_since = inf
        if command is None:  # the setpoint is ahead of a finger that presses: so it goes on pressing
            command = replace(self._command, position=min(max(2 * self._setpoint, 0.0), MAX_GAP))
        self._command = command

    def _judge(self, now: float, error: float, speed: float, at_limit: bool) -> None:
        self._still_since = min(self._still_since, now) if abs(speed) < AT_REST else inf
        is_settled = now - self._still_since >= SETTLED and not self._waiting
        self.is_at_goal = is_settled and abs(error) < AT_GOAL
        self.is_stalled = is_settled and at_limit and not self.is_at_goal
