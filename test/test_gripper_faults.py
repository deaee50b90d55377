"""Each fault of a gripper's server against each kind of goal: the table in docs/closing.md.

Servers that are killed, in processes of their own: test_gripper_crash.py. With TACTILE_LONG all of them, else each
fault and each goal at least twice.
"""

import os

import pytest
from gripper_faults import FAULTS, FORCE, GOALS, MOST, happens, recover

from tactile_node.grasp.closing import Outcome, TouchLimits

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('control_msgs')]

#: The most that is added to the force of a goal until a gripper that answers stops [N]
OVERSHOOT = TouchLimits().overshoot(TouchLimits().fast_speed)
IN_DOUBT = ('accepts and hangs', 'dies, new server', 'stopped, then woken')


def row(text):
    """Return goal -> (outcome, what the gripper accepts) of words like GOES_ON:close+hold; ``-``: nothing."""
    cells = (word.split(':') for word in text.split())
    return {goal: (None if outcome == 'GOES_ON' else Outcome[outcome], sent.replace('+', ' ').replace('-', ''))
            for goal, (outcome, sent) in zip(GOALS, cells, strict=True)}


#: In the order of GOALS: close, force, partly, widest, preempt, hold
EXPECTED = {
    # its hardware goes on, and nothing more reaches it
    'accepts and hangs': row('NOT_STOPPED:close NOT_STOPPED:close NOT_STOPPED:open NOT_STOPPED:open '
                             'GRIPPER_SILENT:- NOT_STOPPED:close'),
    # the new server does not know the command, and is sent to hold the gripper where it is, or to the slower speed
    'dies, new server': row('NOT_STOPPED:close+hold NOT_STOPPED:close+close TOO_SLOW:open+hold TOO_SLOW:open+hold '
                            'NOT_STOPPED:close+close NOT_STOPPED:close+hold'),
    'rejects': row('GRIPPER_REFUSED:- GRIPPER_REFUSED:- GRIPPER_REFUSED:- GRIPPER_REFUSED:- GRIPPER_REFUSED:- '
                   'GRIPPER_REFUSED:-'),
    # what it accepts late is cancelled at once
    'answers late': row('GRIPPER_SILENT:close GRIPPER_SILENT:close GRIPPER_SILENT:open GRIPPER_SILENT:open '
                        'GRIPPER_SILENT:close GRIPPER_SILENT:close'),
    'stopped, then woken': row('GRIPPER_SILENT:close GRIPPER_SILENT:close GRIPPER_SILENT:open GRIPPER_SILENT:open '
                               'GRIPPER_SILENT:close GRIPPER_SILENT:close'),
    # it goes on under guard, and is held by a goal, because a cancel finds no command
    'succeeds at once': row('TOUCHED:close+hold FORCE_REACHED:close+close+hold REACHED:open REACHED:open '
                            'FORCE_REACHED:close+close+hold GOES_ON:close+hold'),
    'refuses cancels': row('TOUCHED:close+hold FORCE_REACHED:close+close+hold REACHED:open REACHED:open '
                           'FORCE_REACHED:close+close+hold GOES_ON:close+hold'),
    'two servers': row('TOUCHED:close FORCE_REACHED:close+close REACHED:open REACHED:open '
                       'FORCE_REACHED:close+close GOES_ON:close')}

CELLS = [(fault, goal) for i, fault in enumerate(FAULTS) for j, goal in enumerate(GOALS)
         if os.environ.get('TACTILE_LONG') or (i + j) % 3 == 0]


@pytest.mark.parametrize(('fault', 'goal'), CELLS)
def test_a_goal_that_meets_a_fault_ends_truly_and_poisons_none_after_it(ros, fault, goal):
    from gripper_bench import GripperBench
    bench = GripperBench(ros, parameters={'hold': True})
    seen = happens(bench, fault, goal)
    assert (seen.outcome, seen.sent) == EXPECTED[fault][goal]
    assert seen.is_in_doubt == (fault in IN_DOUBT)
    if fault == 'accepts and hangs':  # up to its own effort
        assert not seen.moves_on and seen.strongest <= MOST + 1e-6
    else:
        force = FORCE if goal in ('force', 'preempt', 'hold') else 0.0
        assert not seen.moves_on and seen.strongest <= force + OVERSHOOT
    assert recover(bench, fault) == (Outcome.REACHED, Outcome.TOUCHED)
