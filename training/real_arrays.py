"""Contacts as real arrays show them: unlike gains, speckle, halos, cross-talk, rims, bars, cut by an edge.

Ranges are wider than on any array seen (docs/recognition/real_arrays.md), because a user's skin is one that nobody here
has seen. What is labelled is what is seen: a bar that leaves the pad is a rectangle, a disc of which a half is seen has
no label. Lengths in taxel pitches, pressures as fractions of full scale.
"""

from typing import NamedTuple

import numpy as np
from scipy import ndimage, signal

from tactile_node.contact.pattern import ContactPattern
from tactile_node.shape.patch import joined
from tactile_node.simulator.world import random_contact
from training.forms import STEPS as DISTANCE_STEPS
from training.forms import Forms
from training.samples import LABELS, SMALLEST, UNKNOWN, Samples, samples_from
from training.segmentation import pattern_beside

PADS = ((13, 6), (14, 6), (8, 8), (10, 18), (16, 16), (12, 32), (28, 50), (40, 40))  #: rows and columns
FINER = 3                 #: points a taxel's side at which coverage is counted
CIRCLE, SQUARE, RECTANGLE, RIGHT, ISOSCELES = range(UNKNOWN)
SHARES = (0.2, 0.13, 0.17, 0.06, 0.06, 0.38)  #: of the labels drawn; what is not decided is drawn again
LEAST = (8.0, 25.0, 9.0, 30.0, 30.0, 14.0)  #: areas by label [taxels]
MOST = 500.0
OF_PAD = 0.6              #: of the pad's area at most
SEEN_WHOLE = {CIRCLE: 0.65, SQUARE: 0.9, RIGHT: 0.93, ISOSCELES: 0.93, UNKNOWN: 0.5}  #: least share on the pad
SLIMMEST, STOUTEST = 30.0, 1.4  #: length to width of a bar; of what is seen of a rectangle at least the latter
THINNEST = 1.7            #: width of a bar [pitches]
BARE = 0.8                #: of a bar of equal second moments, the share that a foreign figure covers at most
HOLLOW = 0.3               #: share of circles, squares and rectangles
DOMES = (0.65, 0.2, 0.5, 0.0, 0.0, 0.4)  #: shares of contacts that are round on top, by label
BALL, CYLINDER = 0.32, 2.2  #: stretch of a ball's contact on a curved finger (log); least ratio of a lying cylinder's
THINNEST_WALL = 1.3       #: of a rim [pitches]
RESPONSE = (0.8, 1.8)      #: reading by pressure to this power: a Weiss hand's sum of readings is weight to the 1.64
OVERLAP = 0.8             #: with the best of the five shapes, of foreign figures at most
GAIN, LINE_GAIN, SPECKLE = 0.45, 0.3, 0.5  #: log of the gains of taxels, lines and patches, standard deviation at most
HALO, HALO_REACH = 1.0, (1.0, 4.0)  #: load carried sideways, of the load at most; distance over which it falls
REST = 0.15               #: of the contact's level: what an array that is never at zero reads at rest at most
UNEVEN, UNEVEN_SHARE = (0.4, 1.2), 0.4  #: log of foreign objects' pressure from place to place; share of such ones
FRAGMENT = 12              #: taxels of a foreign contact at least: fewer of them show no form
LEAF = (0.58, 0.74)       #: share of its box that a pointed foreign figure fills: a triangle fills less, a bar more


class Touch(NamedTuple):
    """A contact on a pad whose edges may cut it."""

    pressure: np.ndarray  #: (rows, cols), about 1 under the contact
    covered: np.ndarray   #: (rows, cols), of each taxel
    label: int


def draw_real(rng: np.random.Generator, count: int, on_off: bool, foreign: Forms | None = None) -> Samples:
    """Draw ``count`` samples; ``foreign``: figures of which those unlike the five shapes are used; None: known ones."""
    unlike = None if foreign is None else foreign.chosen(
        (foreign.labels == UNKNOWN) & (foreign.overlaps.max(1) < OVERLAP))
    found: list[tuple[ContactPattern, np.ndarray, int]] = []
    while len(found) < count:
        touch = random_touch(rng, unlike)
        if touch is None:
            continue
        frame = read_by(rng, touch, on_off)
        pattern = pattern_beside(rng, frame, on_off)
        mask = joined(pattern) if pattern.contacts else pattern.mask
        least = FRAGMENT if touch.label == UNKNOWN else SMALLEST
        if pattern.mask.sum() >= least and (touch.covered[mask] > 0.2).mean() > 0.8:
            found.append((pattern, mask, touch.label))
    return samples_from(found)


def random_touch(rng: np.random.Generator, unlike: Forms | None) -> Touch | None:
    """Draw a contact somewhere on a pad; None where what is seen of it does not decide its class."""
    label = int(rng.choice(len(SHARES), p=SHARES))
    if label == UNKNOWN and unlike is None:
        return None
    rows, cols = PADS[rng.integers(len(PADS))]
    most = min(MOST, OF_PAD * rows * cols)
    area = float(np.exp(rng.uniform(np.log(LEAST[label]), np.log(most))))
    margin = int(np.ceil(1.2 * np.sqrt(area))) + 2
    y, x = np.mgrid[-margin * FINER:(rows + margin) * FINER, -margin * FINER:(cols + margin) * FINER]
    y, x = (y + 0.5) / FINER - 0.5, (x + 0.5) / FINER - 0.5
    angle = rng.choice((0.0, np.pi / 2)) + rng.normal(0, 0.08) if rng.random() < 0.4 else rng.uniform(0, 2 * np.pi)
    inset = min(0.5 * np.sqrt(area), 0.35 * min(rows, cols)) * (rng.random() < 0.6)
    y0, x0 = rng.uniform(inset - 0.5, rows - 0.5 - inset), rng.uniform(inset - 0.5, cols - 0.5 - inset)
    u = (x - x0) * np.cos(angle) + (y - y0) * np.sin(angle)
    v = (y - y0) * np.cos(angle) - (x - x0) * np.sin(angle)
    depth = _depth(rng, label, u, v, area, max(rows, cols), unlike)
    pressure = _profile(rng, label, depth, u, v)
    if label == UNKNOWN and rng.random() < UNEVEN_SHARE:  # its outline at half of the peak is a fragment of it
        pressure = pressure * np.exp(rng.uniform(*UNEVEN) * _smooth(rng, depth.shape, 0.35 * np.sqrt(area)))
    inner = slice(margin * FINER, -margin * FINER), slice(margin * FINER, -margin * FINER)
    if not _is_decided(label, depth >= 0, inner, u, v):
        return None
    return Touch(_taxels(pressure[inner]), _taxels((depth >= 0)[inner].astype(float)), label)


def read_by(rng: np.random.Generator, touch: Touch, on_off: bool) -> np.ndarray:
    """Return what a real array reads of it."""
    shape = touch.pressure.shape
    blurred = ndimage.gaussian_filter(touch.pressure, rng.uniform(0, 0.9), mode='constant')
    speckle = ndimage.gaussian_filter(rng.standard_normal(shape), scale := rng.choice((0.0, rng.uniform(0.4, 1.2))))
    speckle *= rng.uniform(0, SPECKLE) / (speckle.std() + 1e-9) if scale else rng.uniform(0, SPECKLE)
    gain = rng.uniform(0, GAIN) * rng.standard_normal(shape)
    lines = sum(rng.uniform(0, LINE_GAIN) * rng.standard_normal(size) for size in ((shape[0], 1), (1, shape[1])))
    blurred = blurred + rng.choice((0.0, rng.uniform(0, HALO))) * _halo(rng, blurred)
    values = blurred * np.exp(speckle + gain + lines)
    for of_lines in (values, values.T):
        weak = rng.random(len(of_lines)) < rng.choice((0.0, 0.04))
        of_lines[weak] *= rng.uniform(0.05, 0.6)
    values = _with_cross_talk(rng, values)
    values = np.maximum(values, 0) ** np.exp(rng.uniform(*np.log(RESPONSE)))
    level = rng.uniform(0.1, 1.3)
    values = values + rng.choice((0.0, 0.0, 0.0, rng.uniform(0, REST))) * rng.uniform(0.4, 1, shape)
    values = level * values + rng.choice((0.0, rng.uniform(0, 0.02))) * rng.standard_normal(shape)
    values[values < rng.choice((0.0, rng.uniform(0, 0.2))) * level] = 0  # what the electronics takes for idle
    if on_off:
        return (values >= rng.uniform(0.25, 0.6) * level).astype(float)
    steps = rng.choice((255, 4095))
    frame: np.ndarray = np.round(np.clip(values, 0, 1) * steps)
    return frame


def _halo(rng: np.random.Generator, load: np.ndarray) -> np.ndarray:
    """Return what the cover carries to each taxel, by one of five laws of the distance, in sum the load."""
    down, along = (np.arange(-size + 1, size) for size in load.shape)
    reach = rng.uniform(*HALO_REACH)
    away, in_lines = np.hypot(down[:, np.newaxis], along) / reach, np.add.outer(np.abs(down), np.abs(along)) / reach
    laws = (1 + away ** 2) ** -1.5, (1 + away ** 2) ** -1.0, np.exp(-away), np.exp(-in_lines), np.exp(-away ** 2 / 2)
    law = laws[rng.integers(len(laws))]
    found: np.ndarray = signal.fftconvolve(load, law / law.sum(), mode='same')
    return found


def _smooth(rng: np.random.Generator, shape: tuple[int, ...], length: float) -> np.ndarray:
    """Draw a field of mean 0 and standard deviation 1 at the points, alike over ``length`` [pitches]."""
    coarse = tuple(max(4, round(size / FINER / length) + 2) for size in shape)
    field = ndimage.zoom(rng.standard_normal(coarse), np.divide(shape, coarse), order=2)
    found: np.ndarray = (field - field.mean()) / field.std()
    return found


def _with_cross_talk(rng: np.random.Generator, values: np.ndarray) -> np.ndarray:
    """Add a part of the neighbours in a row or column, and of all the line."""
    axis, next_to, line = int(rng.integers(2)), rng.uniform(0, 0.15), rng.choice((0.0, rng.uniform(0, 0.06)))
    neighbours = ndimage.convolve1d(values, (1.0, 0.0, 1.0), axis=axis, mode='constant')
    found: np.ndarray = values + next_to * neighbours + line * values.max(axis, keepdims=True)
    return found


def _taxels(points: np.ndarray) -> np.ndarray:
    """Means over the points of each taxel."""
    rows, cols = points.shape[0] // FINER, points.shape[1] // FINER
    means: np.ndarray = points.reshape(rows, FINER, cols, FINER).mean((1, 3))
    return means


def _depth(rng: np.random.Generator, label: int, u: np.ndarray, v: np.ndarray, area: float, longest: int,
           unlike: Forms | None) -> np.ndarray:
    """Distance from the outline, positive inside, about exact near it."""
    if label == CIRCLE:
        stretch = np.exp(rng.uniform(-BALL, BALL) * (area < 60) / 2 + rng.uniform(-0.05, 0.05))
        uneven = 1 + rng.choice((0.0, 0.06)) * np.cos(rng.integers(2, 6) * np.arctan2(v, u) + rng.uniform(0, 6))
        return np.sqrt(area / np.pi) * uneven - np.hypot(u * stretch, v / stretch)
    if label in (SQUARE, RECTANGLE):
        length, width = _sides(rng, label, area, longest)
        rounding = rng.choice((0.0, rng.uniform(0, 0.5))) * width / 2
        beyond = np.abs(u) - length / 2 + rounding, np.abs(v) - width / 2 + rounding
        outside = np.hypot(np.maximum(beyond[0], 0), np.maximum(beyond[1], 0))
        return rounding - outside - np.minimum(np.maximum(*beyond), 0)
    if label != UNKNOWN:
        contact = random_contact(rng, LABELS[label], area, rows=1, cols=1)
        return contact.depth(u + contact.x, v + contact.y)
    assert unlike is not None  # random_touch draws no foreign contact without them
    return _foreign_depth(rng, u, v, area, longest, unlike)


def _sides(rng: np.random.Generator, label: int, area: float, longest: int) -> tuple[float, float]:
    if label == SQUARE:
        ratio = np.exp(rng.uniform(-0.08, 0.08))
        return np.sqrt(area * ratio), np.sqrt(area / ratio)
    if rng.random() < 0.4:
        ratio = np.exp(rng.uniform(np.log(1.5), np.log(4)))
        return np.sqrt(area * ratio), np.sqrt(area / ratio)
    width = max(THINNEST, np.exp(rng.uniform(np.log(THINNEST), np.log(max(2.5, 0.3 * longest)))))
    return float(width * np.exp(rng.uniform(np.log(2.2), np.log(SLIMMEST)))), float(width)


def _foreign_depth(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, area: float, longest: int,
                   unlike: Forms) -> np.ndarray:
    if rng.random() < 0.25:
        depth = _whole_foreign_depth(rng, u, v, area, longest, unlike)
        return depth + rng.uniform(0.05, 0.15) * np.sqrt(area) * _smooth(rng, u.shape, 1.5)  # a ragged rim
    return _whole_foreign_depth(rng, u, v, area, longest, unlike)


def _whole_foreign_depth(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, area: float, longest: int,
                         unlike: Forms) -> np.ndarray:
    kind = rng.random()
    if kind < 0.25:
        k, unit = rng.integers(len(unlike.labels)), np.sqrt(area)
        col, row = (unlike.middle[k][axis] + of / unit / unlike.cell[k] for axis, of in ((0, u), (1, v)))
        near = ndimage.map_coordinates(unlike.distance[k].astype(float), (row, col), order=1, cval=-127)
        return near / DISTANCE_STEPS * unit
    width = max(THINNEST, rng.uniform(0.12, 0.4) * np.sqrt(area))
    if kind < 0.41:
        return _hook(rng, u, v, width, longest)
    if kind < 0.56:
        return _bow(rng, u, v, width)
    if kind < 0.66:
        return _stalk(rng, u, v, area)
    if kind < 0.80:
        return _parts(rng, u, v, area)
    if kind < 0.93:
        return _leaf(rng, u, v, area)
    ratio = rng.uniform(1.7, 2.4)  # an oval
    a, b = np.sqrt(area * ratio / np.pi), np.sqrt(area / ratio / np.pi)
    return (1 - np.hypot(u / a, v / b)) * b


def _hook(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, width: float, longest: int) -> np.ndarray:
    """A bar with one or two bends."""
    turn = rng.choice((-1, 1)) * rng.uniform(0.6, 2.4)
    arms = rng.uniform(2.2, 7) * width, np.exp(rng.uniform(np.log(2.2 * width), np.log(max(3 * width, longest))))
    points = [np.zeros(2), arms[0] * np.array((np.cos(turn), np.sin(turn))), np.array((arms[1], 0.0))]
    parts = [_bar(u, v, points[0], end, width) for end in points[1:]]
    if rng.random() < 0.25:
        bent = points[2] + rng.uniform(2, 5) * width * np.array((np.cos(turn), np.sin(turn) * rng.choice((-1, 1))))
        parts.append(_bar(u, v, points[2], bent, width))
    return np.max(parts, axis=0)


def _bow(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, width: float) -> np.ndarray:
    """A bent bar: a part of a ring, of at most three fifths of it, its middle off its chord by its width or more."""
    radius = np.exp(rng.uniform(np.log(1.6), np.log(16))) * width
    half = rng.uniform(np.arccos(1 - 0.8 * width / radius), 1.9)
    middle = radius * np.sinc(half / np.pi)
    angle = np.arctan2(v, u + middle)
    away = np.abs(np.hypot(u + middle, v) - radius)
    return np.minimum(width / 2 - away, (half - np.abs(angle)) * radius)


def _stalk(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, area: float) -> np.ndarray:
    """A round or oval blob with a bar that leaves it."""
    radius, stretch = 0.45 * np.sqrt(area), np.exp(rng.uniform(0, 0.4))
    blob = radius - np.hypot(u * stretch, v / stretch)
    away = radius * rng.uniform(1.8, 4) * np.exp(1j * rng.uniform(0, 2 * np.pi))
    return np.maximum(blob, _bar(u, v, np.zeros(2), np.array((away.real, away.imag)), radius * rng.uniform(0.4, 1)))


def _leaf(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, area: float) -> np.ndarray:
    """What two discs have in common: pointed at both ends, its middle bent off the line between them."""
    ratio = np.exp(rng.uniform(np.log(1.7), np.log(5)))
    wide = np.sqrt(area / (1.36 * ratio))
    radius = wide * (ratio ** 2 + 1) / 4
    bend = rng.uniform(-0.25, 0.25) * wide * np.cos(2 * u / (wide * ratio))
    return np.min([radius - np.hypot(u, v - bend + side * (radius - wide / 2)) for side in (-1, 1)], axis=0)


def _parts(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, area: float) -> np.ndarray:
    """Two to five ovals or bars near each other: a rock, the jaws of a tool."""
    count = int(rng.integers(2, 6))
    size, place, parts = np.sqrt(area / count), np.zeros(2), []
    for _ in range(count):
        turn = rng.uniform(0, np.pi)
        x, y = u - place[0], v - place[1]
        along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
        ratio, part = np.exp(rng.uniform(0, 0.5)), size * rng.uniform(0.6, 1.2)
        parts.append(part / 2 - np.hypot(along / ratio, across * ratio))
        angle = rng.uniform(0, 2 * np.pi)
        place = place + (1.25 * part + rng.uniform(0.5, 2.5)) * np.array((np.cos(angle), np.sin(angle)))
    return np.max(parts, axis=0)


def _bar(u: np.ndarray, v: np.ndarray, start: np.ndarray, end: np.ndarray, width: float) -> np.ndarray:
    du, dv = end - start
    along = np.clip(((u - start[0]) * du + (v - start[1]) * dv) / (du * du + dv * dv), 0, 1)
    return width / 2 - np.hypot(u - start[0] - along * du, v - start[1] - along * dv)


def _profile(rng: np.random.Generator, label: int, depth: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Pressure at each point: flat, round on top, higher at the rim, or of a hollow object's rim alone; tilted."""
    inside, deepest = depth >= 0, max(float(depth.max()), 1e-3)
    share = np.clip(depth / deepest, 0, 1)
    if label in (CIRCLE, SQUARE, RECTANGLE) and deepest > 2 * THINNEST_WALL and rng.random() < HOLLOW:
        wall = rng.uniform(THINNEST_WALL, max(THINNEST_WALL + 0.1, 0.6 * deepest))
        pressure = inside * np.where(depth <= wall, 1.0, rng.choice((0.0, rng.uniform(0, 0.3))))
    elif rng.random() < DOMES[label] and (label != RECTANGLE or _fits_lengthwise(inside, deepest)):
        pressure = np.sqrt(np.clip(1 - (1 - share) ** 2, 0, 1)) * inside  # of a ball or a lying cylinder
    else:
        pressure = inside * (1 + rng.uniform(-0.3, 0.6) * (1 - share) ** 2)
    towards, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(0, 1.2) * (rng.random() < 0.7)
    towards = towards if label != RECTANGLE or rng.random() < 0.5 else 0.0  # a bar is often held at one end
    rise = np.cos(towards) * u + np.sin(towards) * v
    found: np.ndarray = pressure * np.exp(tilt * rise / max(2 * float(rise[inside].std()), 0.5))
    return found


def _fits_lengthwise(inside: np.ndarray, deepest: float) -> bool:
    """Whether a bar is slim enough for a cylinder that lies on the pad."""
    return bool(inside.sum() / FINER ** 2 > CYLINDER * (2 * deepest) ** 2)


def _is_decided(label: int, inside: np.ndarray, pad: tuple[slice, slice], u: np.ndarray, v: np.ndarray) -> bool:
    """Whether what is seen on the pad shows the class."""
    seen = np.zeros_like(inside)
    seen[pad] = inside[pad]
    if seen.sum() < LEAST[label] * FINER ** 2:
        return False
    along, across = (float(np.ptp(of[seen])) for of in (u, v))
    if label == RECTANGLE:
        return max(along, across) >= STOUTEST * min(along, across) and min(along, across) >= THINNEST - 0.3
    if seen.sum() < SEEN_WHOLE[label] * inside.sum():
        return False
    if label != UNKNOWN or _fill(u[seen], v[seen]) < BARE or _is_oval(u[seen], v[seen]):
        return True
    longer = max(along, across) > 1.6 * min(along, across)
    return bool(longer and LEAF[0] < seen.sum() / FINER ** 2 / (along * across) < LEAF[1])


def _fill(u: np.ndarray, v: np.ndarray) -> float:
    """Area of the points relative to that of a bar of the same second moments."""
    spread = np.cov(u, v)
    return float(len(u) / FINER ** 2 / (12 * np.sqrt(max(np.linalg.det(spread), 1e-9))))


def _is_oval(u: np.ndarray, v: np.ndarray) -> bool:
    """Whether they fill an ellipse that no one takes for a bar: a bar has a fill of 1, an ellipse of pi / 3."""
    low, high = np.linalg.eigvalsh(np.cov(u, v))
    return bool(_fill(u, v) > 1.02 and 1.6 < np.sqrt(high / low) < 2.6)
