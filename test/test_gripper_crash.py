"""Tests of goals sent after the gripper's own action server was killed or stopped.

The gripper, the gripper node and the client are separate processes, because the middleware shows a killed server for 20
s. Without TACTILE_LONG, one gripper is killed and one is stopped. test_gripper_faults.py tests the other goals and
faults in virtual time.
"""

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from action_msgs.msg import GoalStatus
from built_messages import environment_with
from virtual_gripper import START

from tactile_node.gripper.rules.closing import Outcome

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('control_msgs')]

# Timeout for an answer from the gripper [s]. Fast DDS repeats a lost message after 3 s, so the timeout is longer than
# that.
TIMEOUT = 5.0
FORGOTTEN = 20.0  #: Time after which Fast DDS forgets a killed server; without a server, a goal ends after TIMEOUT [s].
# Time for the gripper node to discover a gripper that has already discovered the node [s].
DISCOVERY = 2.0
# Jaw opening when the gripper is fully open [m].
WIDEST = 0.08
# Jaw opening of a goal that closes the gripper from WIDEST [m].
NARROW = 0.078
# Jaw opening of a goal that closes the gripper from START [m].
NARROWER = 0.055
#: Distance by which a gripper closes in one step [m]. A gripper that was stopped may receive the cancel many seconds
#: after SIGCONT, because Fast DDS forgets a process that is silent for 20 s. In 10 s, the gripper closes by 15 mm and
#: still touches nothing.
TRAVEL = '0.00003'
PAUSE = 0.01  #: Pause between two looks [s].
# Number of steps in a period of the frames. A low rate saves processor time, and no test touches an object.
FRAME_STEPS = 10
LONG = pytest.mark.long


class Gripper:
    """The process of gripper_process.py, with the lines that it has printed.

    Each time the gripper in this process comes to rest, the motor of ``bench`` moves to the same opening. The gripper
    reports that it has reached a goal once ``bench`` has published this opening.
    """

    def __init__(self, kind, bench):
        self.lines, self._bench = [], bench
        bench.motor.move_to(START)
        command = [sys.executable, str(Path(__file__).with_name('gripper_process.py')), kind, TRAVEL]
        self.process = subprocess.Popen(command, env=environment_with('control_msgs'), stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in iter(self.process.stdout.readline, ''):
            self.lines.append(line.strip())
            event, _, opening = line.partition(' ')
            if event in ('reached', 'cancelled'):
                self._bench.motor.move_to(float(opening))
            if event == 'reached':
                sent = self._bench.pads.sent
                while self._bench.pads.sent < sent + 2:
                    time.sleep(PAUSE)
                self.process.stdin.write('\n')
                self.process.stdin.flush()

    def send(self, number):
        self.process.send_signal(number)

    def kill(self):
        self.process.kill()
        self.process.wait()


class Site:
    """The gripper node and the gripper as separate processes, with the pads and a client in this process."""

    def __init__(self, bench):
        self.bench, self.grippers = bench, []

    def gripper(self, kind):
        """Start a gripper, and wait until the gripper node has discovered its server."""
        gripper = Gripper(kind, self.bench)
        self.grippers.append(gripper)
        self.bench.until(lambda: 'ready' in gripper.lines)
        self.bench.wait(DISCOVERY)
        return gripper

    def wait(self, pause, handle):
        """Wait after the gripper was killed. If the pause is longer than FORGOTTEN, wait for the end of the goal."""
        self.bench.wait(pause)
        if pause > FORGOTTEN:
            self.bench.client.result(handle)

    def goal(self, position):
        """Send a goal, and return its final status, outcome and text."""
        status, _, outcome = self.bench.close(position=position)
        return status, Outcome(outcome.outcome), outcome.message

    def begun(self, position, gripper):
        """Send a goal, and return its handle once the gripper has accepted the goal."""
        handle = self.bench.client.send(position=position)
        self.bench.until(lambda: f'accepted {position:g}' in gripper.lines)
        return handle

    def cancelled(self, handle):
        handle.cancel()
        status, _, outcome = self.bench.client.result(handle)
        return status, Outcome(outcome.outcome), outcome.message


@pytest.fixture
def site(ros):
    from gripper_bench import GripperBench
    bench = GripperBench(ros, has_node=False)
    with bench.node_as_process(f'answer_timeout:={TIMEOUT}'):
        bench.motor.kill()
        bench.pads.steps = FRAME_STEPS
        site = Site(bench)
        try:
            yield site
        finally:
            for each in site.grippers:
                each.send(signal.SIGCONT)
                each.kill()


IN_DOUBT = 'may still be moving'
REACHED = GoalStatus.STATUS_SUCCEEDED, Outcome.REACHED


@pytest.mark.parametrize('goal', ['close', pytest.param('partly', marks=LONG), pytest.param('widest', marks=LONG)])
@pytest.mark.parametrize('pause', [0.2, pytest.param(5.0, marks=LONG), pytest.param(25.0, marks=LONG)])
def test_a_gripper_that_is_killed_and_restarted_opens_and_closes_again(site, pause, goal):
    position = {'close': 0.0, 'partly': 0.07, 'widest': WIDEST}[goal]
    first = site.gripper('hangs')
    handle = site.begun(position, first)
    first.kill()
    site.wait(pause, handle)
    second = site.gripper('works')
    status, outcome, text = site.cancelled(handle)
    if pause > FORGOTTEN:
        assert outcome in (Outcome.NO_GRIPPER, Outcome.NOT_STOPPED)
    else:  # A goal to open ends as cancelled if the new gripper confirms that it is holding its position.
        assert outcome in (Outcome.NOT_STOPPED, Outcome.CANCELED if position else Outcome.NOT_STOPPED)
    assert IN_DOUBT in text
    assert site.goal(WIDEST)[:2] == REACHED and second.lines[-1] == f'reached {WIDEST}'
    assert site.goal(NARROW)[:2] == REACHED and second.lines[-1] == f'reached {NARROW}'
    assert IN_DOUBT not in site.goal(WIDEST)[2]


@LONG
@pytest.mark.parametrize('pause', [0.2, 5.0, 25.0])
def test_a_restarted_gripper_that_rejects_is_reported_as_that(site, pause):
    first = site.gripper('hangs')
    handle = site.begun(0.0, first)
    first.kill()
    assert site.cancelled(handle)[1] in (Outcome.NOT_STOPPED, Outcome.NO_GRIPPER)
    site.bench.wait(pause)
    site.gripper('rejects')
    assert site.goal(WIDEST)[1] is Outcome.GRIPPER_REFUSED
    assert site.goal(NARROW)[1] is Outcome.GRIPPER_REFUSED


@LONG
@pytest.mark.parametrize('pause', [0.2, 5.0, 25.0])
@pytest.mark.parametrize('position', [WIDEST, NARROWER])
def test_a_goal_replaces_one_of_a_killed_gripper(site, position, pause):
    first = site.gripper('hangs')
    handle = site.begun(0.0, first)
    first.kill()
    site.wait(pause, handle)
    second = site.gripper('works')
    _, outcome, text = site.goal(position)
    assert f'reached {position}' in second.lines
    if pause > FORGOTTEN and position != WIDEST:
        # The first goal has ended with the doubt. The gripper closes because it is known to be at rest.
        assert outcome is Outcome.REACHED
    else:
        assert outcome is (Outcome.REACHED if position == WIDEST else Outcome.NOT_STOPPED) and IN_DOUBT in text
    assert site.goal(NARROW)[:2] == REACHED


def test_a_stopped_gripper_that_wakes_up_carries_out_nothing_old(site):
    gripper = site.gripper('works')
    assert site.goal(WIDEST)[:2] == REACHED
    gripper.send(signal.SIGSTOP)
    status, outcome, text = site.goal(0.0)
    assert (status, outcome) == (GoalStatus.STATUS_ABORTED, Outcome.GRIPPER_SILENT) and IN_DOUBT in text
    assert site.goal(0.0)[1] is Outcome.GRIPPER_SILENT  # The node does not send this goal to the gripper.
    gripper.send(signal.SIGCONT)
    site.bench.until(lambda: any(line.startswith('cancelled') for line in gripper.lines))
    assert site.bench.motor.opening > site.bench.pads.width
    assert gripper.lines.count('accepted 0') == 1 and 'reached 0' not in gripper.lines
    assert site.goal(WIDEST)[:2] == REACHED
    assert site.goal(NARROW)[:2] == REACHED


@LONG
def test_a_gripper_that_is_stopped_in_mid_close_is_not_sent_another_close(site):
    gripper = site.gripper('works')
    handle = site.begun(0.0, gripper)
    gripper.send(signal.SIGSTOP)
    assert site.cancelled(handle)[1] is Outcome.NOT_STOPPED
    assert site.goal(NARROWER)[1] is Outcome.GRIPPER_SILENT
    status, outcome, text = site.goal(WIDEST)
    assert outcome is Outcome.GRIPPER_SILENT and IN_DOUBT in text
    gripper.send(signal.SIGCONT)
    site.bench.until(lambda: any(line.startswith('cancelled') for line in gripper.lines))
    assert site.goal(WIDEST)[:2] == REACHED and site.goal(NARROW)[:2] == REACHED
    assert f'accepted {NARROWER}' not in gripper.lines
