"""The steps that press objects: foam, block, jig, weight and proof."""

import math
from typing import Any

import numpy as np

from tactile_node.commissioning import jig
from tactile_node.commissioning.block_grip import (
    MOST_SKEW,
    BlockFace,
    BlockGrip,
    Stall,
    measure_faces,
    measure_grip,
    print_of,
    repair,
    stiffness_of,
)
from tactile_node.commissioning.commissioned_gripper import Act
from tactile_node.commissioning.force import Close, map_effort, predict_overshoot, remaining_share, safe_force
from tactile_node.commissioning.guarded_gripper import REACT, TOUCHED, Move
from tactile_node.commissioning.lateral_shift import HungWeight, shift_of, shift_per_load
from tactile_node.commissioning.measurement import Estimate
from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.movement import StopWay
from tactile_node.commissioning.plan import GaugeBlock
from tactile_node.commissioning.recording import Recording
from tactile_node.commissioning.session import FIRST_SHARE, STOPPED_TIME, UNTIL_HELD, UPPER_ENDS, Session

PROBE_SHARES = (0.08, 0.16)  #: Forces of the first two stalls on a block, as shares of the force limit.
STALLS = 7              #: Number of further stalls on a block.
DEPTH = 0.002           #: Depth to which these stalls press further into the skins, unless the force limits it [m].
STALL_TIME = 0.5        #: Duration of the recording of a stall [s].
FOAM_SHARE = 0.5        #: Force on the foam, as a share of the force limit.
FOAM_STALLS = 4         #: Smallest number of stalls on the foam.
FOAM_FACTOR = 1.2       #: Factor between two efforts on the foam.
LET_GO_TIME = 2.0       #: Time for which the force is watched after a stop on the foam [s].
PROMISED = 1.1          #: Force that is promised to the person, as a multiple of the force at which the foam step ends.
BLOCK_SHARE = 0.95      #: Largest commanded force on a block, as a share of the force limit. The pads may read more.
BACK = 0.002            #: Opening beyond the object before a close [m].
PROOF_FACTOR = 2.0      #: Force at which the gripper would stall, as a multiple of the force that stops a close.
SLOWEST = 2e-4          #: Slowest closing speed [m/s].
READING_NOISES = 3.0    #: Largest of some hundred readings, in deviations above their mean.
CLOSE_LIMIT = 90.0      #: Time allowed for a close [s].
SETTLED_FRAMES = 10     #: Number of frames from which the force after a close is averaged.
LOOSE_SHARE = 0.3       #: Share of the force below which the object was pulled out.


def press_foam(session: Session) -> dict[str, Any]:
    """Press foam with rising effort, and find whether a stop lets go of it."""
    stalls = session.attempt(_squeeze, session)
    effort = stalls[-1].effort
    kept = {way.value: session.attempt(_remaining_share, session, effort, LET_GO_TIME, way)
            for way in (StopWay.CANCEL, StopWay.GOAL)}
    held = session.attempt(_remaining_share, session, effort, session.plan.hold_time)
    return {'efforts': [stall.effort for stall in stalls], 'forces': [stall.force for stall in stalls],
            'stiffness': stiffness_of(stalls), 'kept': kept, 'held': held}


def _squeeze(session: Session) -> list[Stall]:
    """Let the person insert the foam, and return the stalls on the foam at rising efforts."""
    goal = FOAM_SHARE * session.plan.force_limit
    effort = session.record['first movement']['effort']
    session.insert(Act.FOAM, f'Hold the foam between the pads{UNTIL_HELD}')
    rises = np.log(session.plan.most_effort / effort) / np.log(FOAM_FACTOR)
    session.gripper.consent(f'foam, closing{session.to(session.closed_end)} with rising effort ({UPPER_ENDS})',
                            session.closing(session.plan.most_effort), PROMISED * goal, int(rises) + 5)
    stalls: list[Stall] = []
    while effort <= session.plan.most_effort:
        stalls.append(_stall(session, effort, 'foam'))
        if abs(stalls[-1].reading - session.closed_end) < FIRST_SHARE * session.plan.travel:
            raise RefusedStepError('foam', Mistake.BLOCK_MISSING, expected='foam that holds the gripper open',
                                   got='a closed gripper', remedy='Hold stiffer or thicker foam between the pads.')
        if stalls[-1].force >= goal and len(stalls) >= FOAM_STALLS:
            return stalls
        known = map_effort([stall.effort for stall in stalls], [stall.force for stall in stalls])
        rise = known.effort(1.05 * goal) / effort if known.is_known else FOAM_FACTOR
        effort *= min(max(rise, 1.05), FOAM_FACTOR)
    if not stalls or stalls[-1].force < TOUCHED:
        raise RefusedStepError('foam', Mistake.BLOCK_MISSING, expected='a force on both pads', got='none',
                               remedy='Hold the foam between the pads.')
    return stalls


def _remaining_share(session: Session, effort: float, seconds: float, way: StopWay | None = None) -> Estimate:
    """Return the share of the force on the foam that is left after a stop, or without commands."""
    _stall(session, effort, 'foam')
    before = session.gripper.watch(STALL_TIME, 'foam', may_touch=True)
    ended = session.gripper.now()
    if way is not None:
        session.stop_by(way, session.closing(effort))
    after = session.gripper.watch(seconds, 'foam', may_touch=True)
    pad = session.order[0]
    times = np.concatenate((before.pads[pad].times, after.pads[pad].times))
    forces = np.concatenate([session.force_of(each)[0] for each in (before, after)])
    taxels = session.plan.grid.rows * session.plan.grid.cols
    drift = abs(session.found.rests[pad].drift.value) * taxels * (times[-1] - times[0])
    return remaining_share(times, forces, ended, drift)


def press_block(session: Session, block: GaugeBlock) -> dict[str, Any]:
    """Press a free block with rising effort."""
    return session.attempt(_grip, session, block)._asdict()


def _grip(session: Session, block: GaugeBlock) -> BlockGrip:
    _, grip = _press(session, block, Act.BLOCK, f'Hold the block of {1e3 * block.width:g} mm freely between the pads'
                     f'{UNTIL_HELD}', MOST_SKEW)
    return grip


def _press(session: Session, block: GaugeBlock, act: Act, text: str, most_skew: float) -> tuple[list[Stall], BlockGrip]:
    """Let the person insert a block, and return the stalls on the block at rising efforts, and the measured grip."""
    where = f'block of {1e3 * block.width:g} mm'
    session.insert(act, text, block.width)
    limit = session.plan.force_limit
    move = session.closing(_effort_for(session, limit))
    session.gripper.consent(f'{where}, closing{session.to(move.position)} with rising effort ({UPPER_ENDS})', move,
                            limit, len(PROBE_SHARES) + STALLS)
    stalls = [_held_stall(session, _effort_for(session, share * limit), where) for share in PROBE_SHARES]
    first, second = stalls[-2:]
    widest = max(each.width for each in session.plan.blocks)
    # rough change of the opening per unit of the reading, if the travel spans the widest block twice
    metres = -session.towards * 2 * widest / session.plan.travel
    closed = max(abs(second.reading - first.reading), session.gripper.noise) * abs(metres)
    work = second.force + abs(second.force - first.force) / closed * DEPTH
    foam = session.record['foam']
    most = min(BLOCK_SHARE * limit, safe_force(foam['efforts'], foam['forces'], limit), work)
    for force in np.linspace(second.force, most, STALLS + 1)[1:]:
        stalls.append(_held_stall(session, _effort_for(session, float(force)), where))
        if stalls[-1].force > limit:
            break
    return stalls, measure_grip(stalls, session.places, block.width, block.length, metres, most_skew)


def press_jig(session: Session) -> dict[str, Any]:
    """Press the block in the jig, whose place in the frame of the gripper is known."""
    faces = session.attempt(_grip_jig, session)
    stated = ', '.join(f'{1e3 * each:.1f}' for each in session.plan.jig[:3])
    session.ask(Act.MEASURE, 'While the gripper holds the block, measure where its centre lies along the closing '
                f'direction. --jig states the place {stated} mm in the frame of the gripper. If the centre lies '
                'elsewhere, start the command again later with the measured place.')
    return {'faces': faces}


def _grip_jig(session: Session) -> tuple[BlockFace, BlockFace]:
    """Return the faces of the block in the jig on both pads."""
    block = session.plan.jig_block
    stalls, _ = _press(session, block, Act.JIG, f'Put the block of {1e3 * block.width:g} mm into the jig. Hold the '
                       'face A against the palm, and the faces B and C at their places beside it. Hold the block on '
                       'the floor of the groove with a finger on its top, away from the pads.', jig.MOST_SKEW)
    faces = measure_faces(stalls, session.places)
    jig.check_jig(faces)
    return faces


def hang_weight(session: Session) -> dict[str, Any]:
    """Hang the weight on the object, in several grips."""
    return {'grips': [hung._asdict() for hung in session.attempt(_weigh, session)]}


def _weigh(session: Session) -> list[HungWeight]:
    found = [session.attempt(_hang, session) for _ in range(session.plan.shift_grips)]
    shift, reason = shift_per_load([_shift(session, hung) for hung in found])
    if not shift.is_known:
        raise RefusedStepError('weight', Mistake.BLOCK_SLID, expected='two grips that agree', got=reason,
                               remedy='Hang the weight without a jerk, below the middle of the object.')
    return found


def _shift(session: Session, hung: HungWeight) -> float:
    return shift_of(hung, session.plan.weight, session.plan.down)


def _hang(session: Session) -> HungWeight:
    session.insert(Act.OBJECT, 'Hold the block between the pads, in the orientation of use.',
                   session.plan.middle_block.width)
    effort = _effort_for(session, session.plan.weight)
    move = session.closing(effort)
    session.gripper.consent(f'grip for the weight, closing{session.to(move.position)}', move,
                            session.plan.force_limit, 1)
    before = _held_stall(session, effort, 'weight')
    session.ask(Act.WEIGHT, f'Hang the weight of {session.plan.weight:g} N on the object.')
    recording = session.gripper.watch(STALL_TIME, 'weight', may_touch=True)
    loaded = Stall(before.effort, before.reading, _images(session, recording))
    first, second = ((print_of(each.images[0], session.places[0]), print_of(each.images[1], session.places[1]))
                     for each in (before, loaded))
    hung = HungWeight(first, second, loaded.forces)
    _shift(session, hung)  # refuses a weight that does not hang
    return hung


def prove_parameters(session: Session) -> dict[str, Any]:
    """Close ten times until the pads read a force."""
    found = session.found
    law, way = found.law, found.stop_by
    if law is None or way is None:
        return {'closes': [], 'reason': 'the opening is not known' if law is None else 'no way to stop is reliable'}
    plan, block = session.plan, session.plan.middle_block
    grip = found.grips[plan.blocks.index(block)]
    slope = abs(law.slope(grip.onset.value).value)
    stiffness = found.stiffness_at(grip).upper
    speed = max(SLOWEST, min(plan.overshoot / (found.latency * stiffness), found.speed.value))
    # The largest of several readings exceeds the true force by their noise.
    noise = max(rest.noise.value for rest in found.rests) * math.sqrt(plan.grid.rows * plan.grid.cols)
    predicted = predict_overshoot(found.latency, speed, stiffness, found.rounding) + READING_NOISES * noise
    session.insert(Act.OBJECT, f'Hold the block of {1e3 * block.width:g} mm between the pads{UNTIL_HELD}', block.width)
    start = grip.onset.value - session.towards * BACK / slope
    move = Move(session.closed_end, _effort_for(session, PROOF_FACTOR * plan.touch_force), speed / slope)
    session.gripper.consent(f'proof, closing{session.to(move.position)} until a pad reads {plan.touch_force:g} N', move,
                            plan.touch_force + predicted, plan.closes)
    closes = [session.attempt(_close, session, move, start, way, grip) for _ in range(plan.closes)]
    return {'closes': closes, 'speed': speed, 'predicted': predicted, 'reason': ''}


def _close(session: Session, move: Move, start: float, way: StopWay, grip: BlockGrip) -> Close:
    session.gripper.move(session.free(start)._replace(effort=move.effort), 'proof', may_touch=True)
    session.gripper.command(move)
    limit = session.plan.touch_force
    strongest = 0.0

    def is_reached(part: Recording) -> bool:
        nonlocal strongest
        strongest = max(strongest, *(float(each.max(initial=0.0)) for each in session.force_of(part)))
        return strongest >= limit
    session.gripper.watch(CLOSE_LIMIT, 'proof', may_touch=True, tick=REACT, is_over=is_reached)
    if strongest < limit:
        raise _pulled_out()
    due = session.gripper.now()
    session.stop_by(way, move)
    after = session.gripper.watch(STOPPED_TIME, 'proof', may_touch=True)
    forces = session.force_of(after)
    peak = max((0, 1), key=lambda number: forces[number].max())
    largest = int(np.argmax(forces[peak]))
    held = grip.stiffness.value * session.towards * (session.gripper.reading - grip.onset.value)  # force of the block
    if forces[peak][-1] < LOOSE_SHARE * min(held, limit):
        raise _pulled_out()
    left, right = (float(each[-SETTLED_FRAMES:].mean()) for each in forces)
    return Close(float(forces[peak][largest]) - limit,
                 float(after.pads[session.order[peak]].times[largest]) - due, (left, right))


def _pulled_out() -> RefusedStepError:
    return RefusedStepError('proof', Mistake.PULLED_OUT, expected='an object between the pads', got='no force',
                            remedy='Put the object back, and leave it there.')


def _stall(session: Session, effort: float, where: str) -> Stall:
    """Close with an effort until the gripper stalls, and record it at rest."""
    session.gripper.move(session.closing(effort), where, may_touch=True)
    recording = session.gripper.watch(STALL_TIME, where, may_touch=True)
    return Stall(effort, float(recording.joint.positions.mean()), _images(session, recording))


def _held_stall(session: Session, effort: float, where: str) -> Stall:
    """Return a stall against the block, which must be there."""
    stall = _stall(session, effort, where)
    if stall.force < TOUCHED:
        raise RefusedStepError(where, Mistake.BLOCK_MISSING, expected='a force on both pads', got='none',
                               remedy='Hold the block between the pads until the gripper grips it.')
    return stall


def _images(session: Session, recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean force on each taxel of the left and of the right pad [N]."""
    left, right = (repair(recording.pads[pad].mean, session.gripper.is_faulty[pad]) for pad in session.order)
    return left, right


def _effort_for(session: Session, force: float) -> float:
    """Return the effort that presses with a force on a pad, by the map from the foam."""
    foam = session.record['foam']
    known = map_effort(foam['efforts'], foam['forces'])
    if not known.is_known:
        raise RefusedStepError('foam', Mistake.BLOCK_MISSING, expected='a force that rises with the effort',
                               got='another one', remedy='Repeat the foam with another record.')
    return min(max(known.effort(force), session.record['first movement']['effort']), session.plan.most_effort)
