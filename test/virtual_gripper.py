"""A simulated gripper with two pads, without ROS.

The gripper carries out the goals of its own action. Its pads press on a spring. The clock of a bench is virtual, and
the bench calls ``step`` of the gripper and of the pads once in each STEP.
"""

import math

STEP = 0.01  #: Period of the motor [s].
STEPS = 2  #: Number of motor periods per frame period.
PERIOD = STEPS * STEP  #: Period of the frames [s].
THRESHOLD = 0.05  #: Force above which a pad counts as touched [N].
AGE = 0.015  #: Age of the readings when they are sent [s].
START = 0.06  #: Opening of the gripper at the start [m].


class Motor:
    """The motor of a gripper. It moves to its goal, keeps its position after a cancel, and accepts a new goal early.

    A goal has an ``opening`` [m], a ``speed`` [m/s] (0 for the motor's own speed) and ``is_cancel_requested``. The
    motor calls ``publish(opening)`` and, at the end, ``end(status, **flags)`` with the name of a status of rclpy.
    """

    def __init__(self, steady):
        self._steady = steady
        self.opening, self.slowness = START, 1.0
        self.rejects = False  #: True if the motor rejects goals
        self.cancels = False  #: True if a client has cancelled a command
        self.stays = False  #: True if the motor refuses to cancel a goal
        self.never_ends = False  #: True if a replaced command never gets a result
        self.is_silent = False  #: True if the server does not respond
        self.goes_on = False  #: True if the hardware continues the last command while the server is silent
        self.is_hasty = False  #: True if the motor reports success at once, before it has reached its goal
        self.coasts = False  #: True if the motor continues to its goal after a cancel
        self.most_goals = 1000
        self.commands = []  #: accepted goals
        self.directions: list[str] = []  #: directions of the accepted goals
        self.default_speed, self.blocked_at, self.moved_at = 0.02, -1.0, -math.inf
        self._goal = None
        self._target, self._speed = self.opening, 0.0

    @property
    def is_accepting(self):
        return not self.rejects and len(self.commands) < self.most_goals

    @property
    def moves(self):
        return self._goal is not None

    def move_to(self, opening):
        """Set the opening to ``opening`` [m] immediately."""
        self.opening = self._target = opening

    def go_on_to(self, opening, speed):
        """Move to ``opening`` [m] at ``speed`` [m/s], although no goal asks for it."""
        self._target, self._speed = opening, speed

    def accept(self, goal):
        if self._goal is not None and not self.never_ends:
            self.end('abort')
        self.commands.append(goal)
        way = goal.opening - self.opening
        self.directions.append('hold' if abs(way) < 1e-3 else 'open' if way > 0 else 'close')
        self._goal, self._target, self._speed = goal, goal.opening, goal.speed or self.default_speed
        if self.is_hasty:
            self.end('succeed', reached_goal=True)

    def end(self, status, **flags):
        """End the current goal."""
        goal, self._goal = self._goal, None
        goal.end(status, **flags)

    def step(self):
        if self.is_silent:
            if self.goes_on:
                self._move()
            return
        if self._goal is not None and self._goal.is_cancel_requested:
            self.cancels = True
            if not self.coasts:
                self._target = self.opening
            self.end('canceled')
        target = self._move()
        if self._goal is None:
            return
        if self.opening == self._target:
            self.end('succeed', reached_goal=True)
        elif self.opening == target:
            self.end('abort', stalled=True)
        else:
            self._goal.publish(self.opening)

    def _move(self):
        travel = self._speed * STEP / self.slowness
        target = max(self._target, self.blocked_at)
        before = self.opening
        self.opening += max(-travel, min(travel, target - self.opening))
        if self.opening != before:
            self.moved_at = self._steady()
        return target


class Pads:
    """Two pads that touch an object of ``width`` [m].

    ``change`` modifies the readings before they are sent. A subclass defines ``send``.
    """

    def __init__(self, motor, width=0.04, off=0.0, stiffness=1000.0):
        self._motor = motor
        self._steps = 0
        self.steps = STEPS  #: Number of periods of the motor in a period of the frames.
        self.width, self.off, self.stiffness = width, off, stiffness
        self.change = lambda readings: readings
        self.is_silent, self.knows_gap = False, True
        self.strongest = 0.0

    def forces(self):
        closed = self.width - self._motor.opening
        return [max(0.0, self.stiffness * (closed + side * 2 * self.off)) for side in (-1, 1)]

    def step(self):
        self.strongest = max(self.strongest, *self.forces())
        self._steps += 1
        if self._steps % self.steps == 0 and not self.is_silent:
            self.send()
