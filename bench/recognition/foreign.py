"""Draw foreign contacts, to report how often the recogniser rejects them.

The training must not import this module.

A contact is foreign if its best overlap with any of the five shapes is below FOREIGN. The overlap is computed with
enclosed holes filled, because a ring counts as a circle that presses only with its rim.
"""

import numpy as np
from matplotlib.font_manager import FontProperties
from matplotlib.path import Path
from matplotlib.textpath import TextPath

from bench.recognition.stamp import Drawing, Stamp, drawn

FOREIGN = 0.85  #: Limit of the intersection over union. A figure above this limit may be taken for the shape.
FONTS = ('DejaVu Sans', 'DejaVu Serif', 'DejaVu Sans Mono', 'STIXGeneral')
LETTERS = 'ABCEFGHKLMNPQRSTUVWXYZ2345679&?'
REACH = 0.9     #: Distance from the centre that a figure reaches in its square.


def bank(rng: np.random.Generator, family: str, drawing: Drawing, count: int) -> list[Stamp]:
    """Draw ``count`` foreign figures of ``family``."""
    stamps: list[Stamp] = []
    while len(stamps) < count:
        stamp = drawn(family, rng, drawing)
        if stamp.overlap < FOREIGN:
            stamps.append(stamp)
    return stamps


def _disc(x: np.ndarray, y: np.ndarray, at: tuple[float, float], radius: float) -> np.ndarray:
    return np.hypot(x - at[0], y - at[1]) <= radius


def _box(x: np.ndarray, y: np.ndarray, low: tuple[float, float], high: tuple[float, float]) -> np.ndarray:
    return (x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1])


def _within(path: Path, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return True for points inside an odd number of polygons in ``path``, which is scaled to fill the square."""
    low, high = path.get_extents().get_points()
    points = np.column_stack((x.reshape(-1), y.reshape(-1))) * ((high - low).max() / 2 / REACH) + (low + high) / 2
    inside = np.zeros(x.size, bool)
    for polygon in path.to_polygons():
        inside ^= Path(polygon).contains_points(points)
    return inside.reshape(x.shape)


def _written(rng: np.random.Generator, text: str) -> TextPath:
    font = FontProperties(family=FONTS[rng.integers(len(FONTS))], weight=('normal', 'bold')[rng.integers(2)])
    return TextPath((0, 0), text, size=100, prop=font)


def letter(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw a capital letter or a digit in one of four fonts, normal or bold."""
    return _within(_written(rng, LETTERS[rng.integers(len(LETTERS))]), x, y)


def text(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw two or three letters on a bar that connects them."""
    written = _within(_written(rng, ''.join(rng.choice(list(LETTERS), rng.integers(2, 4)))), x, y)
    rows, cols = np.flatnonzero(written.any(1)), np.flatnonzero(written.any(0))
    thick = int(rng.uniform(0.12, 0.25) * (rows[-1] - rows[0]))
    written[rows[0] - thick // 2:rows[0] + thick // 2 + 2, cols[0]:cols[-1] + 1] = True
    return written


def gear(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw a gear with four to nine teeth of any slope, 0.25 to 0.5 radii long, and with or without a bore."""
    teeth, depth, flank = rng.integers(4, 10), rng.uniform(0.25, 0.5), rng.uniform(1.2, 6)
    wave = np.clip(flank * np.cos(teeth * np.arctan2(y, x)) + rng.uniform(-0.4, 0.4), -1, 1)
    distance = np.hypot(x, y)
    bore = rng.uniform(0.05, 0.25) if rng.random() < 0.5 else 0.0
    return (distance <= REACH * (1 - depth * (1 - wave) / 2)) & (distance >= bore)


def crescent(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw a disc minus a second disc, whose radius is 0.7 to 0.95 and whose centre is 0.4 to 0.6 radii away."""
    moved, radius = REACH * rng.uniform(0.4, 0.6), REACH * rng.uniform(0.7, 0.95)
    return _disc(x, y, (0, 0), REACH) & ~_disc(x, y, (moved, 0), radius)


def blob(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw a blob with a radius of 1 plus harmonics 2 to 6, with random phases and an RMS amplitude of 0.2 to 0.3."""
    order = np.arange(2, 7)
    weight = rng.standard_normal(len(order)) / np.sqrt(order)
    weight *= rng.uniform(0.2, 0.3) * np.sqrt(2 / (weight ** 2).sum())
    phase = rng.uniform(0, 2 * np.pi, len(order))
    waves = np.cos(np.arctan2(y, x)[..., None] * order + phase) @ weight
    return np.hypot(x, y) <= 0.5 * np.maximum(1 + waves, 0.2)


def cloud(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw a cloud with lobes, bays and holes, where a sum of waves under a Gaussian bell exceeds a level."""
    angle, phase = rng.uniform(0, 2 * np.pi, (2, 14))
    number = rng.uniform(2, 7, 14)
    waves = np.cos(number * (x[..., None] * np.cos(angle) + y[..., None] * np.sin(angle)) + phase).sum(-1)
    return np.exp(-2.2 * (x * x + y * y)) * (1 + 0.28 * waves) >= 0.45


def pair(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw two touching known shapes, each a disc, square, rectangle or triangle, with an area ratio of 0.4 to 1."""
    angle, size = rng.uniform(0, 2 * np.pi), rng.uniform(0.4, 1.0)
    gap = 0.29 * (1 + np.sqrt(size)) * rng.uniform(0.8, 1.3)
    where = gap * np.array((np.cos(angle), np.sin(angle))) / 2
    return _known(rng, x - where[0], y - where[1], 0.3) | _known(rng, x + where[0], y + where[1], 0.3 * size ** 0.5)


def _known(rng: np.random.Generator, x: np.ndarray, y: np.ndarray, size: float) -> np.ndarray:
    """Draw a disc, square, rectangle or triangle at the origin, with about the area of a disc of radius ``size``."""
    angle, kind, ratio = rng.uniform(0, 2 * np.pi), rng.integers(4), rng.uniform(1.5, 2.5)
    u, v = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    if kind == 0:
        return _disc(u, v, (0, 0), size)
    half = 0.886 * size
    if kind < 3:
        wide = half * (1.0 if kind == 1 else ratio ** 0.5)
        return _box(u, v, (-wide, -half * half / wide), (wide, half * half / wide))
    leg = 2 * np.sqrt(2) * half
    return (u >= -leg / 3) & (v >= -leg / 3) & (u + v <= leg / 3)


def hook(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw a hook, which is 150 to 270 degrees of a ring with a straight shank at one end."""
    width, span, shank = rng.uniform(0.14, 0.3), np.radians(rng.uniform(150, 270)), rng.uniform(0.1, 0.8)
    radius = 0.42
    x, y = x + 0.25, y - 0.25
    ring = np.abs(np.hypot(x, y) - radius) <= width / 2
    bow = ring & (np.arctan2(y, x) % (2 * np.pi) <= span)
    return bow | (np.abs(x - radius) <= width / 2) & (y <= 0) & (y >= -shank)


def arc(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw 100 to 260 degrees of a ring, 0.2 to 0.45 radii wide and with round ends."""
    radius, half = 0.65, np.radians(rng.uniform(100, 260)) / 2
    thick = radius * rng.uniform(0.2, 0.45) / 2
    ends = [(radius * np.cos(angle), radius * np.sin(angle)) for angle in (-half, half)]
    bow = (np.abs(np.hypot(x, y) - radius) <= thick) & (np.abs(np.arctan2(y, x)) <= half)
    return bow | _disc(x, y, ends[0], thick) | _disc(x, y, ends[1], thick)


def letter_l(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw an L whose arms have a length ratio of 0.7 to 1 and a width of 0.3 to 0.45 times the longer arm."""
    width, short = rng.uniform(0.3, 0.45), rng.uniform(0.7, 1.0)
    u, v = x + 0.5, y + 0.5
    return _box(u, v, (0, 0), (1, width)) | _box(u, v, (0, 0), (width, short))


def cross(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw a cross of two equal bars whose width is 0.25 to 0.4 times their length."""
    half = REACH * rng.uniform(0.25, 0.4)
    return _box(x, y, (-REACH, -half), (REACH, half)) | _box(x, y, (-half, -REACH), (half, REACH))


def ellipse(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw an ellipse whose axes have a ratio of 1.45 to 2.2."""
    return (x / REACH) ** 2 + (y * rng.uniform(1.45, 2.2) / REACH) ** 2 <= 1


FAMILIES: dict[str, Drawing] = {
    'letter': letter, 'text': text, 'gear': gear, 'crescent': crescent, 'blob': blob, 'cloud': cloud,
    'touching pair': pair, 'hook': hook, 'arc': arc, 'L': letter_l, 'cross': cross, 'ellipse': ellipse}
