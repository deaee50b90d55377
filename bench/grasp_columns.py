"""Ways to close a gripper on a displaced item, and a comparison of the reported grasp with the true item.

- `blind`: the gripper's own action closes to the width of the item.
- `touch`: the gripper node closes until it reaches a force.
- `shape`: the gripper node closes with a light force. examples/planner_client.py and examples/grasp_loop.py correct the
  hand. The gripper then squeezes with the same force as in `touch`.
- `hold`: the gripper node closes as in `touch`, then keeps the force and raises it when the item slides.
"""

import time
from collections.abc import Callable, Mapping
from math import cos, degrees, pi, remainder, sin
from types import MappingProxyType
from typing import Any

import numpy as np
from grasp_loop import GraspLoop, Reason
from grasp_session import Session
from planner_client import Correction
from planner_world import AIM

from examples.simulated_gripper.items import Item
from examples.simulated_gripper.model import MAX_GAP
from examples.simulated_gripper.world import Outcome, Place
from tactile_skin.msg import Grasp

FORCE = 5.0         #: Closing force for all items, chosen with validation seeds [N].

#: Light closing force [N]. With less force, the contact of an oblique face is too narrow to show its direction.
TOUCH = 2.0
SQUEEZE = 0.01      #: Distance by which the goal of a blind planner is smaller than the item's width [m].
LIFT = 0.1          #: Height of the lift [m].
SHAKE = 1.0         #: Acceleration of the shake [g].
CLEARANCE = 0.012   #: Extra opening while the hand is corrected [m].
AFTER = 0.5         #: Pause after the shake [s].
TRIES = 4           #: Largest number of closing attempts. Each attempt starts with an open gripper.
UNSEEN = ('NOT_SEEN', 'FORCE_NOT_KNOWN', 'LOST')
LOOK = 0.02         #: Time between two requests to the planner [s].

Record = dict[str, Any]


def grasped(session: Session, column: str, item: Item, place: Place) -> Record:
    """Put ``item`` at ``place``, close, lift and shake the item, and return the record of this start."""
    world = session.world
    session.place(place)
    begin, left_out = time.monotonic(), world.left_out
    record = COLUMNS[column](session, item)
    record |= {'peaks': [*world.peaks.values()], 'closing': time.monotonic() - begin,
               'off': [*world.off_hand()], 'forces': [*world.forces.values()]}
    is_refused = 'reason' in record and 'ending' not in record
    if not is_refused:
        session.moved()
        session.move(lift=session.hand['lift'] + LIFT)
        record['lift'] = session.moved()
        world.shake(SHAKE)
        session.until(lambda: not world.is_moving)
        session.wait(AFTER)
        record['shaken'] = session.moved()
    record |= {'end': _end(world.outcome, is_refused), 'seconds': time.monotonic() - begin,
               'left_out': world.left_out - left_out, 'holds': [*session.holds]}
    return record


def _end(outcome: Outcome, is_refused: bool) -> str:
    if outcome is Outcome.BROKEN or outcome is Outcome.HELD and not is_refused:
        return outcome.value
    return 'refused' if is_refused else Outcome.DROPPED.value


def _blind(session: Session, item: Item) -> Record:
    return {'ending': [session.drive(item.width - SQUEEZE, effort=FORCE)]}


def _touch(session: Session, item: Item) -> Record:
    return {'ending': closed(session, FORCE)}


def _hold(session: Session, item: Item) -> Record:
    session.drive(MAX_GAP, touch=True)  # opening the gripper ends the hold of the previous start
    session.holds.clear()
    return _touch(session, item)


def closed(session: Session, effort: float) -> list[str]:
    """Close with the gripper node, and return the outcomes. After an outcome in UNSEEN, open and try again."""
    endings = [session.drive(0.0, effort=effort, touch=True)]
    while endings[-1] in UNSEEN and len(endings) < TRIES:
        reopen(session)
        endings.append(session.drive(0.0, effort=effort, touch=True))
    return endings


def reopen(session: Session) -> None:
    session.drive(min(session.world.gap + CLEARANCE, MAX_GAP))


def _shape(session: Session, item: Item) -> Record:
    loop, actions, endings = GraspLoop(), list[str](), list[str]()
    while True:
        endings += closed(session, TOUCH)
        order, grasp = _ordered(session, loop)
        if order.kind != 'move':
            break
        actions.append(order.correction.action)
        reopen(session)
        _correct(session, order.correction, grasp)
    record = {'moves': actions, 'touches': endings, 'touched_force': max(session.world.peaks.values()),
              'reason': Reason(order.reason).name, 'contact': int(grasp.contact)}
    if order.kind == 'done':
        record |= {'belief': belief(grasp, session, item)}
        record |= {'ending': closed(session, FORCE)}
    return record


def _ordered(session: Session, loop: GraspLoop):
    """Ask the planner while the loop waits, and return the loop's next command and the latest grasp."""
    loop.closed(time.monotonic())
    while True:
        correction, grasp = session.decide()
        order = loop.next(correction, time.monotonic())
        if order.kind != 'wait':
            return order, grasp
        time.sleep(LOOK)


def _correct(session: Session, correction: Correction, grasp: Grasp) -> None:
    """Move the hand along x and up, and turn the hand about a vertical axis through the midpoint of the grasp.

    The hand has no joints for other rotations. The hand's axes x, y and up are the axes x, z and -y of the left pad's
    frame.
    """
    hand = session.hand
    turn = -correction.tilt[1]
    middle = np.nan_to_num(np.array((grasp.midpoint.x - AIM[0], grasp.midpoint.z))) if turn else np.zeros(2)
    along = np.array((correction.shift[0], 0.0)) + middle - _turned(middle, turn)
    x, y = np.array((hand['x'], hand['y'])) + _turned(along, hand['yaw'])
    session.move(x=float(x), y=float(y), lift=hand['lift'] - correction.shift[1], yaw=hand['yaw'] + turn)


def _turned(vector: np.ndarray, angle: float) -> np.ndarray:
    return np.array(((cos(angle), -sin(angle)), (sin(angle), cos(angle)))) @ vector


def belief(grasp: Grasp, session: Session, item: Item) -> Record:
    """Return the reported class, and the errors of size [mm], place [mm] and yaw [degrees] unless they are bounds."""
    pose, sides = session.world.item_in('left'), np.array(item.face.dimensions[:len(grasp.dimensions)])
    believed: Record = {'class': grasp.class_name, 'confidence': grasp.confidence}
    if not grasp.line_is_bound:
        believed['place_mm'] = 1e3 * float(np.hypot(*(pose.translation[:2] - grasp.centre)))
    if grasp.class_name == item.face.shape and item.length and not item.upright:
        is_whole = ~np.array(grasp.dimension_is_bound, dtype=bool)
        if is_whole.any():
            believed['size_mm'] = 1e3 * float(np.abs(np.array(grasp.dimensions) - sides)[is_whole].max())
        if grasp.symmetry:
            truth = float(np.arctan2(*pose.rotation[1::-1, 0])) + item.face.angle
            believed['yaw_degrees'] = abs(degrees(remainder(grasp.yaw - truth, 2 * pi / grasp.symmetry)))
    return believed


COLUMNS: Mapping[str, Callable[[Session, Item], Record]] = MappingProxyType({
    'blind': _blind, 'touch': _touch, 'shape': _shape, 'hold': _hold})
