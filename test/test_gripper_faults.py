"""Tests of each fault of a gripper's server with each kind of goal, as listed in docs/closing.md.

test_gripper_crash.py tests killed servers, because these tests need separate processes.
"""

import pytest
from control_bench import ControlBench
from gripper_faults import FAULTS, FORCE, GOALS, MOST, happens, recover

from tactile_node.gripper.rules.closing import Outcome
from tactile_node.gripper.rules.touch_settings import TouchSettings

#: Largest overshoot above a goal's force before a gripper that still answers has stopped [N].
OVERSHOOT = TouchSettings().overshoot(TouchSettings().fast_speed)
IN_DOUBT = ('accepts and hangs', 'dies, new server', 'stopped, then woken')


def row(text):
    """Return the outcome and the commands that the gripper accepts, for each goal.

    ``text`` has one word for each goal, and ``-`` means that the gripper accepts no command.
    """
    cells = (word.split(':') for word in text.split())
    return {goal: (None if outcome == 'GOES_ON' else Outcome[outcome], sent.replace('+', ' ').replace('-', ''))
            for goal, (outcome, sent) in zip(GOALS, cells, strict=True)}


#: Expected results in the order of GOALS: close, force, partly, widest, preempt, hold.
EXPECTED = {
    # The hardware keeps moving, and no further command reaches the gripper.
    'accepts and hangs': row('NOT_STOPPED:close NOT_STOPPED:close NOT_STOPPED:open NOT_STOPPED:open '
                             'GRIPPER_SILENT:- NOT_STOPPED:close'),
    # The new server does not know the old command. The new server receives a goal to hold the position or to close more
    # slowly.
    'dies, new server': row('NOT_STOPPED:close+hold NOT_STOPPED:close+close TOO_SLOW:open+hold TOO_SLOW:open+hold '
                            'NOT_STOPPED:close+close NOT_STOPPED:close+hold'),
    'rejects': row('GRIPPER_REFUSED:- GRIPPER_REFUSED:- GRIPPER_REFUSED:- GRIPPER_REFUSED:- GRIPPER_REFUSED:- '
                   'GRIPPER_REFUSED:-'),
    # If the gripper accepts a command late, the node cancels the command at once.
    'answers late': row('GRIPPER_SILENT:close GRIPPER_SILENT:close GRIPPER_SILENT:open GRIPPER_SILENT:open '
                        'GRIPPER_SILENT:close GRIPPER_SILENT:close'),
    'stopped, then woken': row('GRIPPER_SILENT:close GRIPPER_SILENT:close GRIPPER_SILENT:open GRIPPER_SILENT:open '
                               'GRIPPER_SILENT:close GRIPPER_SILENT:close'),
    # The gripper keeps moving under guard. The node stops the gripper with a goal, because a cancel finds no command.
    'succeeds at once': row('TOUCHED:close+hold FORCE_REACHED:close+close+hold REACHED:open REACHED:open '
                            'FORCE_REACHED:close+close+hold GOES_ON:close+hold'),
    'refuses cancels': row('TOUCHED:close+hold FORCE_REACHED:close+close+hold REACHED:open REACHED:open '
                           'FORCE_REACHED:close+close+hold GOES_ON:close+hold'),
    'two servers': row('TOUCHED:close FORCE_REACHED:close+close REACHED:open REACHED:open '
                       'FORCE_REACHED:close+close GOES_ON:close')}

TWO_SERVERS = 'two servers'


def check(bench, fault, goal):
    seen = happens(bench, fault, goal)
    assert (seen.outcome, seen.sent) == EXPECTED[fault][goal]
    assert seen.is_in_doubt == (fault in IN_DOUBT)
    if fault == 'accepts and hangs':  # Here, only the gripper's own effort limit bounds the force.
        assert not seen.moves_on and seen.strongest <= MOST + 1e-6
    else:
        force = FORCE if goal in ('force', 'preempt', 'hold') else 0.0
        assert not seen.moves_on and seen.strongest <= force + OVERSHOOT
    assert recover(bench, fault) == (Outcome.REACHED, Outcome.TOUCHED)


@pytest.mark.parametrize('goal', GOALS)
@pytest.mark.parametrize('fault', [each for each in FAULTS if each != TWO_SERVERS])
def test_a_goal_that_meets_a_fault_ends_truly_and_poisons_none_after_it(fault, goal):
    check(ControlBench(hold=True), fault, goal)


#: The middleware decides which of two servers answers. A new server may also answer for an old one.
SERVERS = [(TWO_SERVERS, 'close'), ('dies, new server', 'force'), *(
    pytest.param(fault, goal, marks=pytest.mark.long) for fault in (TWO_SERVERS, 'dies, new server') for goal in GOALS)]


@pytest.mark.ros
@pytest.mark.bus
@pytest.mark.usefixtures('control_msgs')
@pytest.mark.parametrize(('fault', 'goal'), SERVERS)
def test_a_second_server_of_the_middleware_changes_nothing(ros, fault, goal):
    from gripper_bench import GripperBench
    check(FaultyBench(GripperBench(ros, parameters={'hold': True})), fault, goal)


class FaultyBench:
    """A GripperBench with the methods of a ControlBench."""

    def __init__(self, bench):
        self._bench = bench
        self.motor, self.pads, self.wait, self.until = bench.motor, bench.pads, bench.wait, bench.until

    @property
    def ends(self):
        return [Ended(each) for each in self._bench.client.outcomes]

    def send(self, opening=0.0, force=0.0):
        return self._bench.client.send(position=opening, effort=force)

    def result(self, sent):
        return Ended(self._bench.client.result(sent).outcome)

    def outcome(self, opening=0.0, force=0.0):
        return self.result(self.send(opening, force)).outcome

    def add_twin(self):
        from gripper_bench import ServedMotor
        bench = self._bench
        twin = ServedMotor(bench, bench.interface)
        twin.move_to(bench.motor.opening)
        bench.on_step = lambda step=bench.on_step: (step(), twin.step())
        bench.until_served(2)


class Ended:
    """How a goal or a hold ended, from the message of the gripper node."""

    def __init__(self, message):
        self.outcome, self.text, self.is_hold = Outcome(message.outcome), message.message, message.of_hold
