"""The nine kinds of contacts that recognition got wrong on skins it had never met, as frames of skins of our own.

Each kind is a function of a generator and returns one frame and the right answers. No frame trains anything. Lengths
in taxel pitches.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy import ndimage

from tactile_node.shape.recognition import Shape

FINER = 5             #: points along a taxel's side at which an object is drawn
Figure: TypeAlias = Callable[[np.ndarray, np.ndarray], np.ndarray]  #: pressure at points u, v; 0 outside


class Unmet(NamedTuple):
    """A frame of an unknown skin; an idle frame of it is `rest`."""

    frame: np.ndarray
    rest: np.ndarray
    right: tuple[Shape, ...]  #: the right answers; without a name among them a sure name is wrong


class Skin(NamedTuple):
    """How an array reads a pressure."""

    rows: int
    cols: int
    blur: float = 0.5      #: standard deviation of the spread in the cover [pitches]
    halo: float = 0.0      #: part of the load that the cover carries sideways
    reach: float = 2.0     #: distance over which the halo falls to a third [pitches]
    gain: float = 0.2      #: standard deviation of the log of each taxel's gain
    lines: float = 0.0     #: the same of each row and column
    rest: float = 0.0      #: what taxels read at rest, at most [of the largest pressure]
    noise: float = 0.01    #: standard deviation [of the largest pressure]
    floor: float = 0.0     #: readings below are 0 [of the largest pressure]

    def read(self, rng: np.random.Generator, figure: Figure, y: float, x: float, angle: float) -> Unmet:
        """Return the frame of ``figure`` at a place, with no right answer yet."""
        rows, cols = ((np.arange(n * FINER) + 0.5) / FINER - 0.5 for n in (self.rows, self.cols))
        down, along = np.meshgrid(rows - y, cols - x, indexing='ij')
        cos, sin = np.cos(angle), np.sin(angle)
        pressure = figure(along * cos + down * sin, down * cos - along * sin)
        taxels = pressure.reshape(self.rows, FINER, self.cols, FINER).mean((1, 3))
        taxels = ndimage.gaussian_filter(taxels, self.blur, mode='constant')
        taxels = taxels + self.halo * ndimage.convolve(taxels, _spread(self.reach), mode='constant')
        shape = self.rows, self.cols
        log_gain = self.gain * rng.standard_normal(shape)
        for size in ((self.rows, 1), (1, self.cols)):
            log_gain = log_gain + self.lines * rng.standard_normal(size)
        rest = self.rest * rng.uniform(0.4, 1, shape)
        frames = [part + self.noise * rng.standard_normal(shape) for part in (rest + taxels * np.exp(log_gain), rest)]
        frames = [np.where(part < self.floor, 0.0, np.maximum(part, 0.0)) for part in frames]
        return Unmet(frames[0], frames[1], ())


def _spread(reach: float) -> np.ndarray:
    """Return the halo of one taxel: it falls with the cube of the distance, as stress in a thick layer."""
    most = int(3 * reach)
    y, x = np.mgrid[-most:most + 1, -most:most + 1]
    found: np.ndarray = (1 + (x * x + y * y) / reach ** 2) ** -1.5
    return found / found.sum()


def box(length: float, width: float, corner: float = 0.0, hump: float = 0.0) -> Figure:
    """A flat rectangle with round corners; ``hump``: how much less it presses at its rim than in the middle."""
    def pressure(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        du, dv = np.abs(u) - length / 2 + corner, np.abs(v) - width / 2 + corner
        inside = np.hypot(np.maximum(du, 0), np.maximum(dv, 0)) + np.minimum(np.maximum(du, dv), 0) <= corner
        return inside * (1 - hump * ((2 * u / length) ** 2 + (2 * v / width) ** 2) / 2)
    return pressure


def halo_block(rng: np.random.Generator) -> Unmet:
    """A block on a skin that never reads 0 and carries much of the load sideways."""
    side = rng.uniform(5, 7)
    skin = Skin(10, 18, blur=0.6, halo=rng.uniform(0.4, 0.9), reach=rng.uniform(1.2, 2.5), gain=0.2, rest=0.05,
                noise=0.008)
    return skin.read(rng, box(side, side, 0.3), rng.uniform(4, 5), rng.uniform(4.5, 12.5),
                     rng.normal(0, 0.15))._replace(right=(Shape.SQUARE,))


def uneven_block(rng: np.random.Generator) -> Unmet:
    """A block of which rows and columns answer so unevenly that half of the level cuts it to pieces."""
    side = rng.uniform(6, 8)
    skin = Skin(12, 16, blur=0.5, halo=0.2, gain=0.25, lines=rng.uniform(0.25, 0.45), rest=0.03, noise=0.005)
    return skin.read(rng, box(side, side, 0.3), rng.uniform(4.5, 6.5), rng.uniform(5, 10),
                     rng.normal(0, 0.1))._replace(right=(Shape.SQUARE,))


def few_taxels(rng: np.random.Generator) -> Unmet:
    """A fingertip on six to eight taxels."""
    skin = Skin(12, 12, blur=0.3, gain=0.5, noise=0.0, floor=0.25)
    long = rng.uniform(2.4, 3.4)
    tip = _oval(long, rng.uniform(2.1, 2.9))
    return skin.read(rng, tip, rng.uniform(4, 7), rng.uniform(4, 7), rng.uniform(0, np.pi))._replace(
        right=(Shape.CIRCLE, Shape.UNKNOWN))


def speckled_square(rng: np.random.Generator) -> Unmet:
    """A large square with blunt corners under taxels whose gains are 3:1."""
    side = rng.uniform(12, 16)
    skin = Skin(30, 40, blur=0.7, gain=rng.uniform(0.3, 0.4), noise=0.01)
    return skin.read(rng, box(side, side, 0.2 * side, rng.uniform(0.2, 0.6)), rng.uniform(12, 17), rng.uniform(13, 26),
                     rng.uniform(0, np.pi))._replace(right=(Shape.SQUARE,))


def arch(rng: np.random.Generator) -> Unmet:
    """A part of a hollow rim that leaves the pad at one side."""
    high, wide, wall = rng.uniform(9, 16), rng.uniform(4, 8), rng.uniform(1.2, 2.2)

    def rim(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        within = np.hypot(u / (wide + wall), v / (high + wall)) <= 1
        hollow = np.hypot(u / (wide - wall), v / (high - wall)) <= 1
        return (within & ~hollow) * np.clip(1 - 0.6 * v / high, 0.1, 1.6) + 0.1 * hollow
    skin = Skin(26, 40, blur=0.7, gain=0.25, noise=0.01)
    return skin.read(rng, rim, 25.5 + rng.uniform(-2, 4), rng.uniform(12, 28), np.pi + rng.normal(0, 0.1))._replace(
        right=(Shape.UNKNOWN,))


def weak_beside(rng: np.random.Generator) -> Unmet:
    """A strong round contact on a long, weak pad of skin: what presses most is the circle."""
    radius, weak = rng.uniform(1.5, 2.2), rng.uniform(0.25, 0.4)

    def pressed(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        strong = np.maximum(1 - np.hypot(u, v) ** 2 / radius ** 2, 0) ** 0.5
        return np.maximum(strong, weak * (np.hypot(u / 5, v / 3.5) <= 1))
    skin = Skin(14, 20, blur=0.5, halo=0.3, gain=0.15, rest=0.03, noise=0.005)
    return skin.read(rng, pressed, rng.uniform(5, 8), rng.uniform(7, 12), rng.uniform(0, np.pi))._replace(
        right=(Shape.CIRCLE, Shape.UNKNOWN))


def ragged(rng: np.random.Generator) -> Unmet:
    """A side of a hand or a forefoot with toes: a spindle with a ragged rim, or a fork."""
    long, wide, waves = rng.uniform(9, 20), rng.uniform(3, 6), rng.uniform(0, 2 * np.pi, 4)
    toes = int(rng.integers(0, 4))

    def pressed(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        rim = wide * (1 - np.abs(u / long) ** 2) + sum(0.6 * np.sin(u * k / 2.5 + at) for k, at in enumerate(waves, 1))
        found = np.abs(v - 1.5 * np.sin(u / 6 + waves[0])) <= rim
        for toe in range(toes):
            where = (toe - (toes - 1) / 2) * 1.6 * wide
            found |= np.hypot((u - 0.75 * long) / 4, (v - where) / 2) <= 1
        return found * (0.6 + 0.4 * np.cos(u / 3 + waves[1]) * np.cos(v / 2 + waves[2]))
    skin = Skin(50, 70, blur=0.8, gain=0.25, noise=0.01, floor=0.06)
    return skin.read(rng, pressed, rng.uniform(20, 30), rng.uniform(25, 45), rng.uniform(0, np.pi))._replace(
        right=(Shape.UNKNOWN,))


def covering(rng: np.random.Generator) -> Unmet:
    """An object on most of a small array."""
    skin = Skin(6, 6, blur=0.6, gain=0.2, rest=0.3, noise=0.02)
    return skin.read(rng, _oval(rng.uniform(6, 9), rng.uniform(5, 7)), 2.5 + rng.normal(0, 0.3),
                     2.5 + rng.normal(0, 0.3), rng.uniform(0, np.pi))._replace(right=(Shape.UNKNOWN,))


def fragment(rng: np.random.Generator) -> Unmet:
    """A wide foreign object that presses unevenly: half of its peak outlines a fragment of it."""
    parts = [(rng.uniform(-9, 9), rng.uniform(-7, 7), rng.uniform(2.5, 5), rng.uniform(2, 4), rng.uniform(0.15, 0.4))
             for _ in range(6)]
    parts[0] = (*parts[0][:4], 1.0)

    def pressed(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        found = 0.2 * (np.hypot(u / 11, v / 8) <= 1)
        for x, y, long, wide, level in parts:
            found = np.maximum(found, level * (np.hypot((u - x) / long, (v - y) / wide) <= 1))
        return found
    skin = Skin(30, 36, blur=0.8, gain=0.2, noise=0.01, floor=0.03)
    return skin.read(rng, pressed, rng.uniform(12, 18), rng.uniform(14, 22), rng.uniform(0, np.pi))._replace(
        right=(Shape.UNKNOWN,))


def _oval(length: float, width: float) -> Figure:
    return lambda u, v: (np.hypot(2 * u / length, 2 * v / width) <= 1).astype(float)


KINDS: dict[str, Callable[[np.random.Generator], Unmet]] = {
    'halo': halo_block, 'uneven gains': uneven_block, 'few taxels': few_taxels, 'speckled square': speckled_square,
    'arch': arch, 'weak beside strong': weak_beside, 'ragged': ragged, 'covers the array': covering,
    'fragment': fragment}
