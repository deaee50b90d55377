"""Draw frames of contacts under field conditions, as a skin on a robot measures them, together with the true shape.

Pressures are fractions of full scale. The benchmark uses the nominal conditions for its clean figures.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from tactile_node.simulator.figures import Touching, coverage
from tactile_node.simulator.world import CLASSES, PAD, random_contact
from training.ground_truth.indenters import inscribed_radius
from training.outliers import random_outlier
from training.variants import Hollow, Rounded

THINNEST_WALL = 1.25  #: Smallest width of a rim [pitches]. A thinner rim would break into pieces.


@dataclass(frozen=True)
class Conditions:
    """Faults of a contact and of a skin. At its default value, each fault is absent.

    The frame of an on/off skin is compared with ``threshold`` (a fraction of the contact's pressure). Without blur,
    noise and tilt, and with the default threshold, a taxel is on if its centre is inside the contact.
    """

    on_off: bool = False
    pressure: float = 0.5         #: mean pressure under the contact [fraction of full scale]
    tilt: float = 0.0             #: relative rise of the pressure over the contact's mean radius
    blur: float = 0.0             #: standard deviation with which the elastomer spreads the pressure [pitches]
    noise: float = 0.0            #: standard deviation of the noise [fraction of full scale]
    dead: float = 0.0             #: fraction of taxels known to be dead (NaN)

    #: fraction of taxels stuck at 0 or at the contact's pressure, but not known to be stuck
    stuck: float = 0.0
    silent_lines: int = 0         #: number of adjacent rows or columns that are silent but not known to be silent
    silent_places: int = 1        #: number of silent bands across the contact; bands may overlap

    #: fraction of rows and columns in which some taxels are silent, but not known to be silent
    poor_lines: float = 0.0
    threshold: float = 0.5
    cut: float = 0.0              #: largest fraction of the contact that lies beyond the pad's edge
    second: float = 0.0           #: area of a second contact, as a fraction of the area of the first contact
    gap: float = 4.0              #: smallest distance between the two contacts [pitches]

    #: width of the rim of a hollow contact [fraction of the inscribed radius]; 0 for a solid contact
    wall: float = 0.0
    rounding: float = 0.0         #: radius of the corners [fraction of the inscribed radius]


NOMINAL_PRESSURE = Conditions(tilt=0.2, blur=0.5, noise=0.01, dead=0.03)
NOMINAL_ON_OFF = Conditions(on_off=True)


def random_touching(rng: np.random.Generator, kind: str, area: float, conditions: Conditions,
                    rows: int = PAD, cols: int = PAD) -> Touching:
    """Draw a contact with the given ``kind`` and ``area`` [taxels]. The conditions decide whether the contact is hollow
    or rounded.

    The ``kind`` is a class or a kind of outlier.
    """
    if kind not in CLASSES:
        return random_outlier(rng, kind, area, rows=rows, cols=cols)
    contact = touching = random_contact(rng, kind, area, rows=rows, cols=cols)
    if conditions.rounding and kind != 'circle':
        touching = Rounded(contact, conditions.rounding * inscribed_radius(contact))
    if conditions.wall:
        touching = Hollow(touching, max(conditions.wall * inscribed_radius(contact), THINNEST_WALL))
    return touching


def field_frame(rng: np.random.Generator, kind: str, area: float, conditions: Conditions,
                least_side: int = PAD) -> np.ndarray:
    """Draw a frame with one contact of the given ``kind``.

    The frame is a float array of pressures, or of 0 and 1. A dead taxel is NaN.

    The pad is square. The pad has at least ``least_side`` rows, and enough rows for the contact.
    """
    side = max(least_side, int(np.ceil(3.2 * np.sqrt(area))) + 8)
    touching = random_touching(rng, kind, area, conditions, rows=side, cols=side)
    analog = not conditions.on_off or (conditions.tilt, conditions.blur, conditions.noise,
                                       conditions.threshold) != (0, 0, 0, 0.5)
    covered = coverage(touching, side, side) if analog else _centres_inside(touching, side)
    values = covered * _pressures(rng, touching, area, conditions, shape=covered.shape)
    if conditions.cut:
        values = _cut(rng, covered, values, conditions.cut)
    if conditions.second:
        values = _with_second(rng, values, area, conditions, analog=analog)
    if conditions.blur:
        values = ndimage.gaussian_filter(values, conditions.blur, mode='constant', truncate=3.0)
    if conditions.noise:
        values += conditions.noise * rng.standard_normal(values.shape)
    if conditions.on_off:
        values = (values >= conditions.threshold * conditions.pressure).astype(float)
    return _with_faults(rng, values, conditions)


def _centres_inside(touching: Touching, side: int) -> np.ndarray:
    y, x = np.indices((side, side), float)
    return (touching.depth(x, y) >= 0).astype(float)


def _pressures(rng, touching: Touching, area: float, conditions: Conditions, shape) -> np.ndarray:
    if not conditions.tilt:
        return np.full(shape, conditions.pressure)
    angle, radius = rng.uniform(0, 2 * np.pi), np.sqrt(area / np.pi)
    y, x = np.indices(shape, float)
    rise = (np.cos(angle) * (x - touching.x) + np.sin(angle) * (y - touching.y)) * conditions.tilt / radius
    return np.clip(conditions.pressure * (1 + rise), 0, 1)


def _cut(rng, covered: np.ndarray, values: np.ndarray, most: float) -> np.ndarray:
    """Remove rows or columns at one side of the pad, together with up to a fraction ``most`` of the contact."""
    side = rng.integers(4)
    turned = np.rot90(covered, side)
    lost = np.cumsum(turned.sum(1)) / turned.sum()
    return np.rot90(values, side)[np.searchsorted(lost, most, side='right'):].copy()


def _with_second(rng, values: np.ndarray, area: float, conditions: Conditions, analog: bool) -> np.ndarray:
    """Add a second contact of any class about ``gap`` away from the first contact. It may lie partly beyond the pad."""
    wide = np.pad(values, PAD // 2)
    room = ndimage.distance_transform_edt(wide == 0)
    other = random_contact(rng, CLASSES[rng.integers(len(CLASSES))], area * conditions.second, rows=4, cols=4)
    places = np.argwhere(np.abs(room - other.reach - conditions.gap) < 0.8)
    if not len(places):
        return values
    row, col = places[rng.integers(len(places))]
    moved = replace(other, x=col + other.x - 1.5, y=row + other.y - 1.5)
    y, x = np.indices(wide.shape, float)
    second = coverage(moved, *wide.shape) if analog else moved.depth(x, y) >= 0
    inner = slice(PAD // 2, -(PAD // 2))
    return np.maximum(wide, conditions.pressure * second)[inner, inner]


def _with_faults(rng, values: np.ndarray, conditions: Conditions) -> np.ndarray:
    level = 1.0 if conditions.on_off else conditions.pressure
    if conditions.stuck:
        stuck = rng.random(values.shape) < conditions.stuck
        values[stuck] = level * rng.integers(0, 2, stuck.sum())
    if conditions.silent_lines:
        lines = values if rng.random() < 0.5 else values.T
        touched = np.flatnonzero((lines > level / 2).any(1))
        for _ in range(conditions.silent_places):
            first = rng.choice(touched) if len(touched) else 0
            lines[first:first + conditions.silent_lines] = 0
    if conditions.poor_lines:
        for lines in (values, values.T):
            poor = rng.random(len(lines)) < conditions.poor_lines
            mute = np.where(poor, rng.uniform(0.2, 1, len(lines)), 0)
            lines[rng.random(lines.shape) < mute[:, np.newaxis]] = 0
    if conditions.dead:
        values[rng.random(values.shape) < conditions.dead] = np.nan
    return values
