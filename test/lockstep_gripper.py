"""Run the rules of touch_gripper with the simulated gripper in lockstep, without ROS and on the clock of the physics.

Both pads are acquired every PERIOD, and the grasp from their frames reaches the rules DELAY later.
"""

from collections import deque
from collections.abc import Callable
from math import inf, isfinite
from types import SimpleNamespace
from typing import Any

import numpy as np
from planner_chain import DELAY, PlannerChain
from planner_world import noisy

from examples.simulated_gripper import drive
from examples.simulated_gripper.drive import Command
from examples.simulated_gripper.model import STEP
from examples.simulated_gripper.world import SIDES, World
from tactile_node.gripper.messages import touch_of
from tactile_node.gripper.rules.closing import Outcome, TouchReading
from tactile_node.gripper.rules.commands import Command as SentCommand
from tactile_node.gripper.rules.commands import Commands, GripperResult
from tactile_node.gripper.rules.control import Ending, TouchControl, Wish
from tactile_node.gripper.rules.touch_settings import TouchSettings
from tactile_node.taxel_frame import SkinSide

PERIOD = 0.02  #: time between two frames [s]
LOOK = 0.01    #: time between two checks of the rules [s]
EFFORT = 10.0  #: parameter gripper_effort [N]
ALL_SIDES = SkinSide.FIRST_ROW | SkinSide.LAST_ROW | SkinSide.FIRST_COL | SkinSide.LAST_COL  #: ends of the fingers


class LockstepAction:
    """The gripper's own action, which ends its commands as examples/simulated_gripper/gripper_server.py does."""

    is_there = True

    def __init__(self, world: World):
        self._world = world
        self._answers: deque[Callable[[], None]] = deque()
        self._current: tuple[SentCommand, Commands] | None = None
        self._end_of_stop = inf  # time at which a cancelled command ends [s]

    def send(self, opening: float, speed: float, command: SentCommand, commands: Commands) -> SimpleNamespace:
        self._finish(GripperResult(False, False, False))
        self._world.command(Command(max(opening, 0.0), speed or Command.velocity, EFFORT))
        self._current, self._end_of_stop = (command, commands), inf
        self._answers.append(lambda: commands.on_accepted(command))
        return SimpleNamespace(cancel=lambda: self._cancel(command, commands), repeat_cancel=lambda: None)

    def _cancel(self, command: SentCommand, commands: Commands) -> None:
        self._answers.append(lambda: commands.on_cancelled(command, is_ending=True, is_unknown=False))
        if self._current == (command, commands) and not isfinite(self._end_of_stop):
            self._world.stop_gripper()
            self._end_of_stop = self._world.now + drive.DELAY + 2 * drive.SETTLED

    def _finish(self, result: GripperResult) -> None:
        if self._current is not None:
            (command, commands), self._current = self._current, None
            self._answers.append(lambda: commands.on_result(command, result))

    def work(self) -> None:
        """Send all answers that are due."""
        motor = self._world.drive
        if self._world.now >= self._end_of_stop:
            self._finish(GripperResult(False, False, False))
        elif not isfinite(self._end_of_stop) and (motor.is_stalled or motor.is_at_goal):
            self._finish(GripperResult(motor.is_at_goal, motor.is_stalled, True))
        while self._answers:
            self._answers.popleft()()


class LockstepGripper:
    """A simulated gripper with the rules of touch_gripper.

    Parameters
    ----------
    world
        Physics.
    settings
        Settings of the rules.
    random
        Source of the noise of the taxels.
    """

    def __init__(self, world: World, settings: TouchSettings, random: np.random.Generator):
        self.world, self._random, self._chain = world, random, PlannerChain(ALL_SIDES)
        self._action = LockstepAction(world)
        self._control = TouchControl(settings, self._action, SimpleNamespace(text='', has_listened=True), self._on_end,
                                     why_unseen=str, commands_speed=True, steady=lambda: world.now)
        self._sent: deque[tuple[float, TouchReading, float]] = deque()  # arrival [s], readings, opening [m]
        self._next_frame = 0.0
        self.endings: list[Ending] = []  #: ends of all goals and holds
        self.height = 0.0                #: goal of the hand's lift [m]

    def _on_end(self, handle: Any, ending: Ending) -> None:
        self.endings.append(ending)

    def close(self, force: float) -> Outcome:
        """Close until the stronger pad reads ``force`` [N], and return the outcome."""
        self.endings.clear()
        self._control.accept(SimpleNamespace(is_cancel_requested=False), Wish(0.0, 0.0, force))
        self.follow(until=lambda: bool(self.endings))
        return self.endings[0].outcome

    def follow(self, seconds: float = inf, lift_speed: float = 0.0, until: Callable[[], bool] = lambda: False) -> None:
        """Advance the physics and the rules for ``seconds``, or until ``until`` returns True."""
        end = self.world.now + seconds - STEP / 2
        while self.world.now < end and not until():
            for _ in range(round(LOOK / STEP)):
                if lift_speed:
                    self.height += lift_speed * STEP
                    self.world.move(lift=self.height)
                self.world.step(STEP)
            self._feel()
            self._action.work()
            self._control.look()

    def _feel(self) -> None:
        now = self.world.now
        while self._sent and self._sent[0][0] <= now + STEP / 2:
            _, touch, gap = self._sent.popleft()
            self._control.touch = touch.after(self._control.touch)
            self._control.measure(gap, touch.acquired)
        if now >= self._next_frame:
            self._next_frame = now + PERIOD - STEP / 2
            values = {side: noisy(self.world.pressures(side), self._random) for side in SIDES}
            grasp = self._chain.grasp(values, self.world.gap, now)
            self._sent.append((now + DELAY, touch_of(grasp, now), self.world.gap))
