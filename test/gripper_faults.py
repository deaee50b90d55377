"""Faults of a gripper's action server during goals, in virtual time, with or without ROS.

The function `happens` runs one of these faults on a bench, which is a ControlBench or has the same methods.
"""

from typing import NamedTuple

from tactile_node.gripper.rules.closing import Outcome

FORCE = 5.0  #: Requested force of a goal [N].
LATE = 0.8  #: Delay that is longer than the answer_timeout [s].
PARTLY = 0.05  #: Target opening of a goal that opens the gripper partway [m].
#: Jaw opening when the gripper is fully open [m].
WIDEST = 0.08
#: Force at which the gripper itself stalls [N].
MOST = 10.0
#: Faults that are present before the goal. All other faults begin after the gripper has accepted its command.
BEFORE = ('rejects', 'answers late', 'succeeds at once', 'refuses cancels', 'two servers', 'stopped, then woken')
FAULTS = ('accepts and hangs', 'dies, new server', *BEFORE)
GOALS = ('close', 'force', 'partly', 'widest', 'preempt', 'hold')


class Happened(NamedTuple):
    """The outcome for the client, the commands to the gripper, and the movement of the gripper."""

    outcome: Outcome | None  #: outcome of the goal or the hold, or None while the hold continues
    is_in_doubt: bool       #: True if the text of the outcome says that the gripper may still be moving
    sent: str               #: directions of the commands that the gripper has accepted
    moves_on: bool          #: True if the gripper still moves 1 s after the outcome
    strongest: float        #: largest force on a pad [N]


def happens(bench, fault, goal):
    """Run ``goal`` with ``fault``, and return the outcome, the commands and the movement."""
    motor = bench.motor
    motor.blocked_at = bench.pads.width - MOST / bench.pads.stiffness
    if goal == 'partly':
        bench.pads.width = 0.0
        motor.move_to(0.03)
        bench.wait(0.2)
    if goal == 'preempt':
        bench.send()
        bench.wait(0.3)
    if goal == 'hold':
        motor.move_to(bench.pads.width + 0.001)
        bench.wait(0.2)
        assert bench.outcome(force=FORCE) == Outcome.FORCE_REACHED
        bench.wait(0.2)
    motor.directions.clear()
    motor.cancels = False
    if fault in BEFORE or goal == 'preempt':
        _break(bench, fault)
    handle = None
    if goal == 'hold':
        bench.pads.width -= 0.0015
        motor.blocked_at -= 0.0015
    else:
        handle = bench.send({'partly': PARTLY, 'widest': WIDEST}.get(goal, 0.0),
                            force=FORCE if goal in ('force', 'preempt') else 0.0)
    if fault not in BEFORE and goal != 'preempt':
        bench.until(lambda: motor.directions)
        _break(bench, fault)
    if fault == 'answers late':
        bench.wait(LATE)
        motor.wake()
    ending = _ending(bench, handle)
    if fault == 'stopped, then woken':
        motor.wake()
    bench.wait(0.7)
    before = motor.opening
    bench.wait(0.3)
    outcome, text = (ending.outcome, ending.text) if ending else (None, '')
    return Happened(outcome, 'may still be moving' in text, ' '.join(motor.directions),
                    motor.opening != before, bench.pads.strongest)


def _ending(bench, handle):
    """Return how a goal or its hold ended, or None while the hold continues."""
    if handle is not None:
        return bench.result(handle)
    bench.wait(4.0)
    ends = [each for each in bench.ends if each.is_hold]
    return ends[0] if ends else None


def _break(bench, fault):
    motor = bench.motor
    if fault == 'accepts and hangs':
        motor.fall_silent(goes_on=True)
    elif fault == 'dies, new server':
        motor.fall_silent(goes_on=True)
        motor.restart()
    elif fault in ('answers late', 'stopped, then woken'):
        motor.fall_silent()
    elif fault == 'rejects':
        motor.rejects = True
    elif fault == 'succeeds at once':
        motor.is_hasty = True
    elif fault == 'refuses cancels':
        motor.stays = True
    else:
        bench.add_twin()


def recover(bench, fault):
    """End ``fault``, and return the outcomes of a goal to open and of a later goal to close."""
    motor = bench.motor
    if fault == 'accepts and hangs':
        motor.restart()
    motor.rejects = motor.stays = motor.is_hasty = False
    motor.blocked_at = -1.0
    opened = bench.outcome(opening=WIDEST)
    bench.pads.width = 0.04
    return opened, bench.outcome()
