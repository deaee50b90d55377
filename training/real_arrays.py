"""Draw contacts as real arrays measure them: with unequal gains, speckle, halos and cross-talk, and cut by pad edges.

The contacts include bars and the rims of hollow objects. The ranges are wider than those measured on any real array
(docs/recognition/real_arrays.md), because the users' skins are unknown.

A label describes only the visible part of a contact. A bar that extends beyond the pad is a rectangle. A disc that is
only half visible has no label and is drawn again. Lengths are in taxel pitches, and pressures are fractions of full
scale.
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

PADS = ((13, 6), (14, 6), (8, 8), (10, 18), (16, 16), (12, 32), (28, 50), (40, 40))  #: Rows and columns of the pads.
FINER = 3        #: Number of sampling points along each side of a taxel.
CIRCLE, SQUARE, RECTANGLE, RIGHT, ISOSCELES = range(UNKNOWN)

#: Share of each label among the drawn contacts. A contact whose visible part does not show its class is drawn again.
SHARES = (0.2, 0.13, 0.17, 0.06, 0.06, 0.38)
LEAST = (8.0, 25.0, 9.0, 30.0, 30.0, 14.0)  #: For each label, the smallest area and smallest visible area [taxels].
MOST = 500.0     #: Largest area [taxels].
OF_PAD = 0.6     #: Largest area, as a share of the pad's area.

#: For each label, the smallest share of the contact that must lie on the pad.
SEEN_WHOLE = {CIRCLE: 0.65, SQUARE: 0.9, RIGHT: 0.93, ISOSCELES: 0.93, UNKNOWN: 0.5}

#: Largest ratio of length to width of a bar, and smallest ratio for the visible part of a rectangle.
SLIMMEST, STOUTEST = 30.0, 1.4
THINNEST = 1.7   #: Smallest width of a bar [pitches].

#: Upper limit of a foreign figure's area, relative to a bar with the same second moments. Fuller figures could be
#: mistaken for bars and are used only if they are oval or pointed.
BARE = 0.8
HOLLOW = 0.3     #: Fraction of hollow contacts among circles, squares and rectangles that have room for a rim.
DOMES = (0.65, 0.2, 0.5, 0.0, 0.0, 0.4)  #: Fraction of contacts with a domed pressure, for each label.

#: BALL is the largest logarithm of the axis ratio when a ball touches a curved finger. CYLINDER is the smallest ratio
#: of length to width when a cylinder lies on its side.
BALL, CYLINDER = 0.32, 2.2
THINNEST_WALL = 1.3  #: Smallest width of a hollow object's rim [pitches].

#: Range of the exponent in the power law from pressure to reading. On a Weiss hand, the sum of the readings is
#: proportional to the weight to the power 1.64.
RESPONSE = (0.8, 1.8)
OVERLAP = 0.8    #: Upper limit of a foreign figure's overlap with each of the five shapes.

#: Largest standard deviations of the logarithms of the taxels' gains, the lines' gains and the speckle.
GAIN, LINE_GAIN, SPECKLE = 0.45, 0.3, 0.5

#: Largest load that the cover carries sideways, relative to the direct load, and range of the distance over which it
#: falls off [pitches].
HALO, HALO_REACH = 1.0, (1.0, 4.0)
REST = 0.15      #: Largest reading at rest on an array that never reads zero, relative to the contact's level.

#: Some foreign objects press unevenly. UNEVEN is the range of the standard deviation of their log pressure, and
#: UNEVEN_SHARE is their share of the foreign contacts.
UNEVEN, UNEVEN_SHARE = (0.4, 1.2), 0.4
FRAGMENT = 12    #: Smallest number of taxels in a foreign contact. The shape of a smaller contact is not visible.

#: A long foreign figure counts as pointed if it fills a share of its bounding box within this range. A triangle fills
#: less, and a bar fills more.
LEAF = (0.58, 0.74)


class Touch(NamedTuple):
    """A contact on a pad. The edges of the pad may cut off part of the contact."""

    pressure: np.ndarray  #: (rows, cols), relative to the contact's level
    covered: np.ndarray   #: (rows, cols), covered fraction of each taxel
    label: int            #: index into LABELS


def draw_real(rng: np.random.Generator, count: int, on_off: bool, foreign: Forms | None = None) -> Samples:
    """Draw samples of contacts as real arrays measure them.

    Parameters
    ----------
    rng : np.random.Generator
        Random generator for all properties of the contacts and arrays.
    count : int
        Number of samples.
    on_off : bool
        True for on/off taxels, False for pressures.
    foreign : Forms, optional
        Pool of foreign figures. Only figures that are unlike the five shapes are used. Without a pool, only contacts of
        the five shapes are drawn.
    """
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
    """Draw a contact at a random place on a pad.

    Parameters
    ----------
    rng : np.random.Generator
        Random generator for the pad and the contact.
    unlike : Forms or None
        Foreign figures that are unlike the five shapes.

    Returns
    -------
    Touch or None
        The contact, or None if its visible part does not show its class. The result is also None if a foreign contact
        is drawn and ``unlike`` is None.
    """
    label = int(rng.choice(len(SHARES), p=SHARES))
    if label == UNKNOWN and unlike is None:
        return None
    rows, cols = PADS[rng.integers(len(PADS))]
    most = min(MOST, OF_PAD * rows * cols)
    area = float(np.exp(rng.uniform(np.log(LEAST[label]), np.log(most))))
    margin = int(np.ceil(1.2 * np.sqrt(area))) + 2
    y, x = np.ogrid[-margin * FINER:(rows + margin) * FINER, -margin * FINER:(cols + margin) * FINER]
    y, x = (y + 0.5) / FINER - 0.5, (x + 0.5) / FINER - 0.5
    angle = rng.choice((0.0, np.pi / 2)) + rng.normal(0, 0.08) if rng.random() < 0.4 else rng.uniform(0, 2 * np.pi)
    inset = min(0.5 * np.sqrt(area), 0.35 * min(rows, cols)) * (rng.random() < 0.6)
    y0, x0 = rng.uniform(inset - 0.5, rows - 0.5 - inset), rng.uniform(inset - 0.5, cols - 0.5 - inset)
    u = (x - x0) * np.cos(angle) + (y - y0) * np.sin(angle)
    v = (y - y0) * np.cos(angle) - (x - x0) * np.sin(angle)
    depth = _depth(rng, label, u, v, area, max(rows, cols), unlike)
    pressure = _profile(rng, label, depth, u, v)
    if label == UNKNOWN and rng.random() < UNEVEN_SHARE:  # a threshold at half of the peak leaves a fragment
        pressure = pressure * np.exp(rng.uniform(*UNEVEN) * _smooth(rng, depth.shape, 0.35 * np.sqrt(area)))
    inner = slice(margin * FINER, -margin * FINER), slice(margin * FINER, -margin * FINER)
    if not _is_decided(label, depth >= 0, inner, u, v):
        return None
    return Touch(_taxels(pressure[inner]), _taxels((depth >= 0)[inner].astype(float)), label)


def read_by(rng: np.random.Generator, touch: Touch, on_off: bool) -> np.ndarray:
    """Return the frame that a real array would measure.

    Parameters
    ----------
    rng : np.random.Generator
        Random generator for the properties of the array.
    touch : Touch
        The contact.
    on_off : bool
        True for on/off taxels, False for pressures.

    Returns
    -------
    np.ndarray
        (rows, cols), 0 and 1 for on/off taxels, whole counts for pressures.
    """
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
    values[values < rng.choice((0.0, rng.uniform(0, 0.2))) * level] = 0  # the electronics reports low readings as zero
    if on_off:
        return (values >= rng.uniform(0.25, 0.6) * level).astype(float)
    steps = rng.choice((255, 4095))
    frame: np.ndarray = np.round(np.clip(values, 0, 1) * steps)
    return frame


def _halo(rng: np.random.Generator, load: np.ndarray) -> np.ndarray:
    """Return the load that the cover carries sideways to each taxel.

    The load falls off with distance by one of five laws. The weights of each law add up to 1.
    """
    down, along = (np.arange(-size + 1, size) for size in load.shape)
    reach = rng.uniform(*HALO_REACH)
    away, in_lines = np.hypot(down[:, np.newaxis], along) / reach, np.add.outer(np.abs(down), np.abs(along)) / reach
    laws = (1 + away ** 2) ** -1.5, (1 + away ** 2) ** -1.0, np.exp(-away), np.exp(-in_lines), np.exp(-away ** 2 / 2)
    law = laws[rng.integers(len(laws))]
    found: np.ndarray = signal.fftconvolve(load, law / law.sum(), mode='same')
    return found


def _smooth(rng: np.random.Generator, shape: tuple[int, ...], length: float) -> np.ndarray:
    """Draw a random field with mean 0 and standard deviation 1.

    The field changes smoothly over the distance ``length`` [pitches].
    """
    coarse = tuple(max(4, round(size / FINER / length) + 2) for size in shape)
    field = ndimage.zoom(rng.standard_normal(coarse), np.divide(shape, coarse), order=2)
    found: np.ndarray = (field - field.mean()) / field.std()
    return found


def _with_cross_talk(rng: np.random.Generator, values: np.ndarray) -> np.ndarray:
    """Add cross-talk along the rows or along the columns.

    Each taxel receives a share of its two neighbours and a share of the highest value in its line.
    """
    axis, next_to, line = int(rng.integers(2)), rng.uniform(0, 0.15), rng.choice((0.0, rng.uniform(0, 0.06)))
    neighbours = ndimage.convolve1d(values, (1.0, 0.0, 1.0), axis=axis, mode='constant')
    found: np.ndarray = values + next_to * neighbours + line * values.max(axis, keepdims=True)
    return found


def _taxels(points: np.ndarray) -> np.ndarray:
    """Return the mean over the points of each taxel, (rows, cols)."""
    rows, cols = points.shape[0] // FINER, points.shape[1] // FINER
    means: np.ndarray = points.reshape(rows, FINER, cols, FINER).mean((1, 3))
    return means


def _depth(rng: np.random.Generator, label: int, u: np.ndarray, v: np.ndarray, area: float, longest: int,
           unlike: Forms | None) -> np.ndarray:
    """Return the distance of each point from the outline of a contact, positive inside.

    The distance is nearly exact close to the outline, and approximate elsewhere.
    """
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
    assert unlike is not None  # random_touch draws no foreign contact without foreign figures
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
        return depth + rng.uniform(0.05, 0.15) * np.sqrt(area) * _smooth(rng, u.shape, 1.5)  # makes the rim ragged
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
    """Return the distance field of a bar with one or two bends."""
    turn = rng.choice((-1, 1)) * rng.uniform(0.6, 2.4)
    arms = rng.uniform(2.2, 7) * width, np.exp(rng.uniform(np.log(2.2 * width), np.log(max(3 * width, longest))))
    points = [np.zeros(2), arms[0] * np.array((np.cos(turn), np.sin(turn))), np.array((arms[1], 0.0))]
    parts = [_bar(u, v, points[0], end, width) for end in points[1:]]
    if rng.random() < 0.25:
        bent = points[2] + rng.uniform(2, 5) * width * np.array((np.cos(turn), np.sin(turn) * rng.choice((-1, 1))))
        parts.append(_bar(u, v, points[2], bent, width))
    return np.max(parts, axis=0)


def _bow(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, width: float) -> np.ndarray:
    """Return the distance field of a bent bar.

    The bar is an arc of at most about three fifths of a ring. The arc rises above its chord by at least 0.8 times the
    width of the bar.
    """
    radius = np.exp(rng.uniform(np.log(1.6), np.log(16))) * width
    half = rng.uniform(np.arccos(1 - 0.8 * width / radius), 1.9)
    middle = radius * np.sinc(half / np.pi)
    angle = np.arctan2(v, u + middle)
    away = np.abs(np.hypot(u + middle, v) - radius)
    return np.minimum(width / 2 - away, (half - np.abs(angle)) * radius)


def _stalk(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, area: float) -> np.ndarray:
    """Return the distance field of a round or oval blob with a bar extending from it."""
    radius, stretch = 0.45 * np.sqrt(area), np.exp(rng.uniform(0, 0.4))
    blob = radius - np.hypot(u * stretch, v / stretch)
    away = radius * rng.uniform(1.8, 4) * np.exp(1j * rng.uniform(0, 2 * np.pi))
    return np.maximum(blob, _bar(u, v, np.zeros(2), np.array((away.real, away.imag)), radius * rng.uniform(0.4, 1)))


def _leaf(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, area: float) -> np.ndarray:
    """Return the distance field of a leaf.

    A leaf is the intersection of two discs, with points at both ends and a bent middle line.
    """
    ratio = np.exp(rng.uniform(np.log(1.7), np.log(5)))
    wide = np.sqrt(area / (1.36 * ratio))
    radius = wide * (ratio ** 2 + 1) / 4
    bend = rng.uniform(-0.25, 0.25) * wide * np.cos(2 * u / (wide * ratio))
    return np.min([radius - np.hypot(u, v - bend + side * (radius - wide / 2)) for side in (-1, 1)], axis=0)


def _parts(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, area: float) -> np.ndarray:
    """Return the distance field of two to five neighbouring ovals, such as bumps on a rock or the jaws of a tool."""
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
    """Return the pressure at each point.

    The pressure is flat, domed, higher or lower at the rim, or mainly on the rim of a hollow object. In most
    contacts, the pressure also increases towards one side.
    """
    inside, deepest = depth >= 0, max(float(depth.max()), 1e-3)
    share = np.clip(depth / deepest, 0, 1)
    if label in (CIRCLE, SQUARE, RECTANGLE) and deepest > 2 * THINNEST_WALL and rng.random() < HOLLOW:
        wall = rng.uniform(THINNEST_WALL, max(THINNEST_WALL + 0.1, 0.6 * deepest))
        pressure = inside * np.where(depth <= wall, 1.0, rng.choice((0.0, rng.uniform(0, 0.3))))
    elif rng.random() < DOMES[label] and (label != RECTANGLE or _fits_lengthwise(inside, deepest)):
        pressure = np.sqrt(np.clip(1 - (1 - share) ** 2, 0, 1)) * inside  # a ball, or a cylinder on its side
    else:
        pressure = inside * (1 + rng.uniform(-0.3, 0.6) * (1 - share) ** 2)
    towards, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(0, 1.2) * (rng.random() < 0.7)
    # a bar is often held at one end, so the pressure often changes along it
    towards = towards if label != RECTANGLE or rng.random() < 0.5 else 0.0
    rise = np.cos(towards) * u + np.sin(towards) * v
    found: np.ndarray = pressure * np.exp(tilt * rise / max(2 * float(rise[inside].std()), 0.5))
    return found


def _fits_lengthwise(inside: np.ndarray, deepest: float) -> bool:
    """Return True if a bar is slim enough to be the contact of a cylinder on its side."""
    return bool(inside.sum() / FINER ** 2 > CYLINDER * (2 * deepest) ** 2)


def _is_decided(label: int, inside: np.ndarray, pad: tuple[slice, slice], u: np.ndarray, v: np.ndarray) -> bool:
    """Return True if the visible part of the contact shows its class."""
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
    """Return the area of the points, relative to the area of a bar with the same second moments."""
    spread = np.cov(u, v)
    return float(len(u) / FINER ** 2 / (12 * np.sqrt(max(np.linalg.det(spread), 1e-9))))


def _is_oval(u: np.ndarray, v: np.ndarray) -> bool:
    """Return True if the points fill an ellipse that cannot be mistaken for a bar.

    The fill of a bar is 1, and the fill of an ellipse is pi / 3.
    """
    low, high = np.linalg.eigvalsh(np.cov(u, v))
    return bool(_fill(u, v) > 1.02 and 1.6 < np.sqrt(high / low) < 2.6)
