"""The steps that observe and press the pads, before the gripper moves."""

from functools import partial
from typing import Any

from tactile_node.commissioning.commissioned_gripper import Act
from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.pad_mounting import (
    PLACES,
    PadMounting,
    Press,
    check_two_pads,
    find_mounting,
    find_press,
)
from tactile_node.commissioning.pad_rest import measure_rest, was_touched
from tactile_node.commissioning.recording import Recording
from tactile_node.commissioning.session import Session
from tactile_node.commissioning.taxel_survey import survey
from tactile_node.grasp.tracker import SIDES

PRESS_TIME = 4.0        #: Duration of the recording of a press [s].
STROKE_TIME = 15.0      #: Duration of the recording in which the person presses everywhere [s].
AGE_TIME = 5.0          #: Time over which the age of the frames is observed [s].


def watch_untouched_pads(session: Session) -> dict[str, Any]:
    """Record the untouched pads."""
    session.ask(Act.LEAVE, f'Do not touch the pads for {session.plan.rest_time:g} s.')
    recording = session.attempt(_record_rest, session)
    age = session.gripper.age_of_frames(AGE_TIME)
    found = [measure_rest(pad) for pad in recording.pads]
    if None in found:
        raise RefusedStepError('rest', Mistake.PADS_SILENT, expected='frames of both pads', got='too few',
                               remedy='Check the driver of the skin.')
    return {'pads': [each._asdict() for each in found if each], 'age': age, 'serial_numbers': session.serial_numbers()}


def _record_rest(session: Session) -> Recording:
    recording = session.gripper.watch(session.plan.rest_time, 'rest', may_touch=True)
    for name, pad in zip(session.plan.pads, recording.pads):
        if was_touched(pad):
            raise RefusedStepError('rest', Mistake.HAND_BETWEEN, expected='untouched pads', got=f'a touch on the '
                                   f'pad {name!r}', remedy='Leave the pads alone until the step has ended.')
    return recording


def find_pads(session: Session) -> dict[str, Any]:
    """Let the person press each pad, and find which pad is left, how the pads are mounted, and faulty taxels."""
    (left, first), (right, second) = session.attempt(_press_both, session)
    strokes = []
    for pad in SIDES:
        session.ask(Act.STROKE, f'Press everywhere on the {pad} pad for {STROKE_TIME:g} s.', pad=pad)
        strokes.append(session.attempt(partial(session.gripper.watch, STROKE_TIME, f'{pad} pad', may_touch=True)))
    findings = {pad: survey([each.pads[pad].forces for each in strokes]) for pad in (0, 1)}
    return {'order': [left, right], 'mountings': [first, second], 'taxels': [findings[pad] for pad in (left, right)]}


def _press_both(session: Session) -> tuple[tuple[int, PadMounting], tuple[int, PadMounting]]:
    left, right = (session.attempt(_press_pad, session, pad) for pad in SIDES)
    check_two_pads(left[0], right[0])
    return left, right


def _press_pad(session: Session, pad: str) -> tuple[int, PadMounting]:
    presses = [session.attempt(_press, session, pad, place) for place in PLACES]
    return find_mounting(presses, f'presses on the {pad} pad')


def _press(session: Session, pad: str, place: str) -> Press:
    session.ask(Act.PRESS, f'Hold the {pad} pad with the fingertip up, look at its skin, and press the {place} for '
                '2 s.', pad=pad, place=place)
    recording = session.gripper.watch(PRESS_TIME, f'press on the {pad} pad', may_touch=True)
    return find_press(recording.pads, f'press on the {pad} pad, {place}')
