"""Tests of each fault of a gripper's server with each kind of goal, as listed in docs/closing.md.

test_gripper_crash.py tests killed servers, because these tests need separate processes. With TACTILE_LONG, the tests
use all combinations. Without TACTILE_LONG, each fault is tested once, and each goal at least once.
"""

import pytest
from gripper_faults import FAULTS, FORCE, GOALS, MOST, happens, recover

from tactile_node.gripper.rules.closing import Outcome
from tactile_node.gripper.rules.touch_settings import TouchSettings

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('control_msgs')]

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

#: Each fault with one of the goals in turn, and then all other combinations.
CELLS = [pytest.param(fault, goal, marks=() if j == i % len(GOALS) else pytest.mark.long)
         for i, fault in enumerate(FAULTS) for j, goal in enumerate(GOALS)]


@pytest.mark.parametrize(('fault', 'goal'), CELLS)
def test_a_goal_that_meets_a_fault_ends_truly_and_poisons_none_after_it(ros, fault, goal):
    from gripper_bench import GripperBench
    bench = GripperBench(ros, parameters={'hold': True})
    seen = happens(bench, fault, goal)
    assert (seen.outcome, seen.sent) == EXPECTED[fault][goal]
    assert seen.is_in_doubt == (fault in IN_DOUBT)
    if fault == 'accepts and hangs':  # Here, only the gripper's own effort limit bounds the force.
        assert not seen.moves_on and seen.strongest <= MOST + 1e-6
    else:
        force = FORCE if goal in ('force', 'preempt', 'hold') else 0.0
        assert not seen.moves_on and seen.strongest <= force + OVERSHOOT
    assert recover(bench, fault) == (Outcome.REACHED, Outcome.TOUCHED)
