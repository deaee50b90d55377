"""Draw contacts with known pose for bench_pose.py, and compute the errors of fits."""

from typing import NamedTuple

import numpy as np

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.pose.fit import ShapeFit
from tactile_node.pose.outlines import OUTLINES
from tactile_node.shape.recognition import Shape
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import Contact, random_contact

PAD = 36
PRESS = 15_000.0    #: Press threshold for a mean pressure of 50 000 Pa [Pa].
RELEASE = 12_000.0  #: Release threshold [Pa].


class Condition(NamedTuple):
    """Conditions under which frames are drawn. If ``skin`` is None, the frames are on/off patterns."""

    skin: Skin | None
    tilt: float = 0.0  #: limit of the uniform random tilt along x and y [relative rise per pitch]


CONDITIONS = {
    'clean': Condition(Skin()),
    'noise 1 %': Condition(Skin(noise=0.01)),
    'tilt 4 %': Condition(Skin(), 0.04),
    'blur 0.5': Condition(Skin(blur=0.5)),
    'dead 3 %': Condition(Skin(dead=0.03)),
    'all four': Condition(Skin(noise=0.01, blur=0.5, dead=0.03), 0.04),
    'on/off': Condition(None),
}


class PoseSample(NamedTuple):
    contact: Contact
    values: np.ndarray
    mask: np.ndarray


def draw(rng: np.random.Generator, shape: str, area: float, condition: Condition) -> PoseSample:
    contact = random_contact(rng, shape, area, rows=PAD, cols=PAD)
    if condition.skin is None:
        pattern = contact.pattern(PAD, PAD)
        return PoseSample(contact, pattern, pattern)
    tilt = tuple(rng.uniform(-condition.tilt, condition.tilt, 2))
    values = pressure_frame(contact, rng, PAD, PAD, tilt=tilt, skin=condition.skin)
    return PoseSample(contact, values, PatternExtractor(PressThresholds(PRESS, RELEASE)).extract(values).mask)


class Error(NamedTuple):
    """Errors of one fit in pitches, degrees and per cent."""

    centre: float
    angle: float
    length: float       #: error of the worst dimension
    vector: np.ndarray  #: errors of all parameters, where the error of the angle allows for the fit's symmetry


def truth(contact: Contact) -> tuple[np.ndarray, int]:
    """Return the parameters of the contact's outline, and its handedness."""
    outline = OUTLINES[Shape(contact.shape)]
    angle = (contact.angle,) if outline.symmetry else ()
    return np.array((contact.x, contact.y, *angle, *contact.dimensions[:len(outline.dimensions)])), contact.handedness


def error(parameters: np.ndarray, symmetry: int, contact: Contact) -> Error:
    return error_from(parameters, symmetry, truth(contact)[0], len(OUTLINES[Shape(contact.shape)].dimensions))


def error_from(parameters: np.ndarray, symmetry: int, true: np.ndarray, count: int) -> Error:
    """Return the error of ``parameters``. The last ``count`` of the ``true`` parameters are dimensions."""
    vector = parameters - true
    if symmetry:
        period = 2 * np.pi / symmetry
        vector[2] = (vector[2] + period / 2) % period - period / 2
    return Error(float(np.hypot(*vector[:2])), float(np.degrees(abs(vector[2]))) if symmetry else np.nan,
                 float(np.abs(vector[-count:] / true[-count:]).max() * 100), vector)


def same_handedness(fit: ShapeFit, contact: Contact) -> bool:
    return not fit.handedness or fit.handedness == truth(contact)[1]
