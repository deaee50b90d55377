"""The steps that move the empty gripper: first movement, stops, and small steps."""

from typing import Any

import numpy as np

from tactile_node.commissioning.commissioned_gripper import DIRECTIONS, Act
from tactile_node.commissioning.guarded_gripper import SILENCE, TOUCHED, Move
from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.movement import StopTrial, StopWay, measure_speed, measure_step, measure_stop
from tactile_node.commissioning.recording import JointStates
from tactile_node.commissioning.session import FIRST_SHARE, FREE_TIME, STOPPED_TIME, UPPER_ENDS, Session

FIRST_EFFORT = 0.01     #: First effort, as a share of the largest one.
EFFORT_FACTOR = 1.4     #: Factor between two efforts while the effort rises.
FREE_SHARE = 0.5        #: Share of the travel that free movements use, from the open end.
PHASES = 0.05           #: Range of the time before a command, so that the phase of the samples varies [s].
STEP_INCREMENT = 2.5e-5  #: Increment of the commands that find the step of the gripper [m].
STEP_RANGE = 6          #: Number of steps of the gripper over which the commands rise at most.
STEP_COMMANDS = 260     #: Largest number of these commands.
SETTLE = 0.2            #: Time between a command in small increments and its recording, in addition to the latency [s].


def move_first(session: Session) -> dict[str, Any]:
    """Find the smallest effort that moves the gripper, and the direction in which it opens."""
    session.clear('first movement')
    noise = session.gripper.measure_noise('first movement')
    effort, opens_rising = session.attempt(_move_and_return, session)
    return {'noise': noise, 'effort': effort, 'opens_rising': opens_rising}


def _move_and_return(session: Session) -> tuple[float, bool]:
    """Return the smallest effort that moves the gripper both ways, and True if the reading rises as it opens.

    All later movements depend on the direction. The person therefore names it twice, and a slip of the hand shows.
    """
    start, way = session.gripper.reading, FIRST_SHARE * session.plan.travel
    is_rising = start < (session.plan.low + session.plan.high) / 2
    away = Move(start + way if is_rising else start - way, FIRST_EFFORT * session.plan.most_effort,
                session.plan.travel / FREE_TIME / 10)
    session.gripper.consent(f'first movement{session.to(away.position)} and the way back, with an effort that rises, '
                            f'at most to {session.plan.most_effort:g}', away, TOUCHED, 2)
    effort = _smallest_effort(session, away)
    answer = session.ask(Act.DIRECTION, 'How have the fingers moved?', DIRECTIONS)
    effort = _smallest_effort(session, away._replace(position=start, effort=effort))
    back = session.ask(Act.DIRECTION, 'The gripper has moved back. How have the fingers moved this time?', DIRECTIONS)
    if answer == back == 'not moved':
        raise RefusedStepError('first movement', Mistake.OTHER_JOINT, expected='fingers that move with the joint',
                               got='a joint that moves alone', remedy='Give the name of the joint of the gripper.')
    if {answer, back} != {'opened', 'closed'}:
        raise RefusedStepError('first movement', Mistake.WRONG_DIRECTION, got=f'"{answer}", then "{back}"',
                               expected='"opened" and "closed", because the gripper has moved there and back',
                               remedy='Watch the fingers, and answer again.')
    return effort, (answer == 'opened') == is_rising


def _smallest_effort(session: Session, move: Move) -> float:
    """Raise the effort until the gripper moves, and return the effort."""
    start, effort = session.gripper.reading, move.effort
    while effort <= session.plan.most_effort:
        session.gripper.command(move._replace(effort=effort))
        session.gripper.watch(1.0, 'first movement', may_touch=False)
        if abs(session.gripper.reading - start) > abs(move.position - start) / 4:
            session.gripper.watch(2.0, 'first movement', may_touch=False)
            return effort
        effort *= EFFORT_FACTOR
    raise session.gripper.stuck('first movement')


def try_stops(session: Session) -> dict[str, Any]:
    """Try each way to stop several times, and measure the speed."""
    target = session.open_end + FREE_SHARE * (session.closed_end - session.open_end)
    session.clear('stops')
    session.gripper.consent(f'stops, back and forth between {session.open_end:.3g} and {target:.3g} '
                            f'{session.plan.unit}', session.free(target), TOUCHED, 6 * session.plan.stop_trials)
    results: dict[str, Any] = {'trials': {}}
    movements: list[JointStates] = []
    for way in StopWay:
        trials = []
        for number in range(session.plan.stop_trials):
            trial, movement = session.attempt(_stop_trial, session, way, number, target)
            trials.append(trial)
            movements.append(movement)
        results['trials'][way.value] = trials
    results['speed'] = measure_speed(movements, session.gripper.noise)
    results['period'] = float(np.median(np.diff(movements[0].times)))
    return results


def _stop_trial(session: Session, way: StopWay, number: int, target: float) -> tuple[StopTrial, JointStates]:
    """Return the outcome of one stop, and the movement back to the open end."""
    gripper = session.gripper
    movement = gripper.move(session.free(session.open_end), 'stops').joint
    phase = (number * 0.618) % 1  # the phase of the samples differs between trials
    before = gripper.watch(0.2 + PHASES * phase, 'stops', may_touch=False)
    commanded = gripper.now()
    start = gripper.reading
    gripper.command(session.free(target))
    distance = (0.2 + 0.2 * phase) * abs(target - start)
    moving = gripper.watch(3.0, 'stops', may_touch=False, tick=0.003,
                           is_over=lambda part: abs(gripper.reading - start) > distance)
    if abs(gripper.reading - start) <= distance:
        raise gripper.stuck('stops')
    stopped = gripper.now()
    session.stop_by(way, session.free(target))
    after = gripper.watch(STOPPED_TIME + FREE_TIME * FREE_SHARE, 'stops', may_touch=False)
    joint = JointStates(*(np.concatenate(each) for each in zip(before.joint, moving.joint, after.joint)))
    return measure_stop(joint, commanded, stopped, target, gripper.noise), movement


def find_step(session: Session) -> dict[str, Any]:
    """Command small increments, at rest after each, and find the levels at which the gripper stays.

    The results are only a reason if the levels cannot be distinguished.
    """
    gripper = session.gripper
    session.clear('step')
    law = session.found.law
    middle = law.middle if law else (session.plan.low + session.plan.high) / 2
    increment = STEP_INCREMENT / abs(law.slope(middle).value) if law else 0.0003 * session.plan.travel
    gripper.consent(f'small steps, after a movement{session.to(middle)} ({UPPER_ENDS})', session.free(middle), TOUCHED,
                    STEP_COMMANDS)
    session.attempt(gripper.move, session.free(middle), 'step')
    settling = session.found.start_latency + SETTLE  # time after which a small movement has ended [s]
    commanded, reached = [], []
    for number in range(STEP_COMMANDS):
        commanded.append(middle + number * increment)
        gripper.command(session.free(commanded[-1]))
        gripper.watch(settling, 'step', may_touch=False)
        joint = gripper.watch(0.15, 'step', may_touch=False).joint
        if not joint.times.size:  # wait for a joint state; the guard refuses a longer silence
            joint = gripper.watch(2 * SILENCE, 'step', may_touch=False,
                                  is_over=lambda part: part.joint.times.size > 0).joint
        reached.append(float(joint.positions.mean()))
        largest_jump = max(np.abs(np.diff(reached)), default=0.0)
        if number > 20 and abs(reached[-1] - reached[0]) > STEP_RANGE * max(largest_jump, 8 * gripper.noise):
            break
    found = measure_step(np.array(commanded), np.array(reached), gripper.noise / 3)
    return {'step': found, 'at': middle, 'increment': increment} if found.is_known else {
        'reason': 'the levels at which the gripper stays cannot be distinguished'}
