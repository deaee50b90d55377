"""The example that lowers an arm: it stops without feedback, and opens only with a second witness."""

import signal
import time
from pathlib import Path

import pytest
from put_down_process import PlannerProcess

from tactile_node.gripper.put_down_goal import PutDownGoal
from tactile_skin.action import PutDown

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('control_msgs')]

STOPPED = 0.2  # Time within which the arm stops after the feedback has ceased [s].
ROOT = Path(__file__).resolve().parents[1]
Feedback, Result = PutDown.Feedback, PutDown.Result


@pytest.fixture
def example(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / 'examples'))
    import put_down
    return put_down


class World:
    """A gripper node, an arm and their clock, all of which follow a script. Each look of the example takes PERIOD.

    Parameters
    ----------
    states : callable
        Function that returns the field ``watching`` of the feedback at a time, or None if no feedback arrives.
    ends : float
        Time at which the goal ends with ``outcome`` [s].
    feels : callable
        Function that returns the arm's contact signal at a time.
    """

    def __init__(self, states, ends, outcome=Result.SOMETHING_TOUCHES, feels=lambda time: False):
        self.now, self._states, self._ends, self._outcome, self._feels = 0.0, states, ends, outcome, feels
        self.goal = PutDownGoal(lambda: self.now)
        self.speeds, self.openings, self.heights = [], [], 0.1

    def put_down(self, timeout):
        return self.goal

    def send(self, position):
        self.openings.append(position)

    def wait(self, goal, timeout, spin=False):
        pass

    def spin_once(self, node, timeout_sec):
        self.now += timeout_sec
        if self.now >= self._ends and self.goal.result is None:
            self.goal.result = Result(outcome=self._outcome)
        elif (state := self._states(self.now)) is not None:
            self.goal.on_feedback(PutDown.Impl.FeedbackMessage(feedback=Feedback(watching=state)))

    def height(self):
        return self.heights

    def lower(self, speed):
        self.speeds.append((self.now, speed))

    def feels_contact(self):
        return self._feels(self.now)

    def moved_last(self):
        """Return the last time at which the arm moved [s]."""
        return max((at for at, speed in self.speeds if speed), default=-1.0)


@pytest.fixture
def run(example, monkeypatch):
    def run(world, highest_table=0.05):
        monkeypatch.setattr(example.rclpy, 'spin_once', world.spin_once)
        return example.put_down(world, None, world, highest_table, steady=lambda: world.now)
    return run


def watching(time):
    return True


WITNESSES = {
    'the arm feels nothing': (lambda time: False, False),
    'the arm feels the table first': (lambda time: time > 4.8, True),
    'the arm feels the table later': (lambda time: time > 5.3, True),
    'the arm feels the table too late': (lambda time: time > 5.7, False),
    'the arm felt something long before': (lambda time: time > 3.0, False),
    'the arm feels something for a moment before': (lambda time: 4.0 < time < 4.2, False),
    'the signal is stuck': (lambda time: True, False)}


@pytest.mark.parametrize('name', WITNESSES)
def test_the_gripper_opens_only_if_the_arm_has_begun_to_feel_a_contact_too(run, name):
    feels, opens = WITNESSES[name]
    world = World(watching, ends=5.0, feels=feels)
    assert run(world).outcome == Result.SOMETHING_TOUCHES
    assert bool(world.openings) == opens and world.speeds[-1][1] == 0 and world.moved_last() < 5.0


@pytest.mark.parametrize('outcome', [getattr(Result, name) for name in (
    'NOT_KNOWN', 'NO_QUIET_BASELINE', 'OBJECT_LOST', 'PAD_UNSEEN', 'TIMED_OUT', 'CANCELED', 'NOT_HELD', 'DRIFTED',
    'GRIPPER_MOVED', 'DUPLICATE', 'REPLACED', 'REFUSED')])
def test_no_other_ending_opens_the_gripper(run, outcome):
    world = World(watching, ends=5.0, outcome=outcome, feels=lambda time: time > 4.9)
    assert run(world).outcome == outcome and not world.openings and world.speeds[-1][1] == 0


def test_the_arm_stops_while_the_feedback_ceases(run):
    world = World(lambda time: watching(time) if time < 2 or 3 < time else None, ends=5.0)
    run(world)
    moves = [at for at, speed in world.speeds if speed]
    assert not [at for at in moves if 2 + STOPPED < at < 3] and moves[-1] > 4.9


def test_the_arm_stops_for_good_if_the_node_is_gone(run):
    world = World(lambda time: watching(time) if time < 2 else None, ends=99.0)
    assert run(world) is None and not world.openings
    assert world.moved_last() < 2 + STOPPED and world.now < 6


def test_the_goal_is_cancelled_if_the_arm_fails(run):
    class Handle:
        is_cancelled = False

        def cancel_goal_async(self):
            self.is_cancelled = True

    class FailingWorld(World):
        def height(self):
            raise ConnectionError
    world = FailingWorld(lambda time: False, ends=5.0)
    world.goal.handle = Handle()
    with pytest.raises(ConnectionError):
        run(world)
    assert world.speeds[-1][1] == 0 and world.goal.handle.is_cancelled


def test_the_arm_moves_neither_before_the_first_feedback_nor_low_during_the_baseline(run):
    def baseline(time):
        return None if time < 1 else time >= 3
    low, high = World(baseline, ends=5.0), World(baseline, ends=5.0)
    low.heights = 0.04
    run(low)
    run(high)
    assert min(at for at, speed in low.speeds if speed) >= 3 - 1e-6
    assert 1 <= min(at for at, speed in high.speeds if speed) < 1.1


@pytest.mark.parametrize('number', [pytest.param(signal.SIGKILL, marks=pytest.mark.long, id='killed'),
                                    pytest.param(signal.SIGSTOP, id='stopped')])
def test_the_arm_stops_after_the_node_was_killed_or_stopped(ros, number):
    """The gripper node and the planner are processes of their own, and the pads are in this process."""
    from gripper_bench import GripperBench
    from test_put_down_node import FORCE, Sides
    bench = GripperBench(ros, has_node=False)
    sides = Sides(bench)
    with bench.node_as_process() as node:
        bench.motor.move_to(bench.pads.width - FORCE / bench.pads.stiffness)
        bench.pads.change = sides.publish_with
        with PlannerProcess() as planner:
            try:
                bench.until(lambda: planner.is_moving)
                bench.wait(1.0)
                bench.until(lambda: planner.is_moving)  # on a busy machine, the arm may wait for a late frame
                since = time.monotonic()
                node.send_signal(number)
                bench.until(lambda: planner.has_ended)
            finally:
                node.send_signal(signal.SIGCONT)
    assert planner.events[-1][0] == 'gone'
    assert planner.stopped_at() - since <= STOPPED
