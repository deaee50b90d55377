"""Measure recognition on skins whose cover carries load sideways, so that the taxels around a contact also respond.

A reading is gain x (pressure + halo) + rest level + noise, limited to the range from 0 to 1.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from bench.recognition.cases import seeded
from bench.recognition.figures import PercentRate
from bench.recognition.page import Table
from bench.recognition.readings import after_idle, alone, stream
from tactile_node import Recogniser
from tactile_node.contact.neighbours import grown
from tactile_node.contact.pattern import ContactPattern
from tactile_node.shape.support import SURE
from tactile_node.simulator.figures import coverage
from tactile_node.simulator.world import CLASSES, Contact, random_contact
from training.ground_truth.seeds import Purpose

SEEDS = 970_000
PADS = ((8, 16), (10, 18), (14, 14), (16, 24))  #: Rows and columns of the pads.
AREAS = 20.0, 60.0    #: Range of the contacts' areas, log-uniform [taxels].
BESIDE = (0.0, 0.1, 0.2, 0.3)  #: Readings next to a contact, as a share of the contact's level.
REACH = 1.2, 3.0      #: Range of the distance over which the halo falls to about a third [pitches].
BLUR = 0.2, 0.7       #: Range of the blur at the edge of a contact [pitches].
TILT = 0.35           #: Largest relative rise of the pressure over the contact's mean radius.
GAINS = 0.25          #: Standard deviation of the logarithm of the taxels' gains.
GAIN_ERROR = 0.1      #: Standard deviation of the logarithm of a measured gain's error.
REST = 0.02, 0.1      #: Range of the level at rest.
REST_SPREAD = 0.3     #: Standard deviation of the taxels' levels at rest, as a share of their mean.
NOISE = 0.006         #: Standard deviation of the noise.
LEVEL = 0.35, 0.9     #: Range of a contact's level.
MOST_HALO = 5.0       #: Largest halo, as a multiple of the pressure that is spread.


class HaloSkin:
    """A skin with a halo.

    Parameters
    ----------
    rng : np.random.Generator
        Generator for the skin and for its contacts.
    beside : float
        Readings next to a contact, as a share of the contact's level.
    """

    def __init__(self, rng: np.random.Generator, beside: float):
        self._rng, self._beside = rng, beside
        self.shape = PADS[rng.integers(len(PADS))]
        self._blur = rng.uniform(*BLUR)
        self._spread = halo_of_taxel(rng.uniform(*REACH))
        self.gains = np.exp(GAINS * rng.standard_normal(self.shape))
        self.rest = rng.uniform(*REST) * np.maximum(1 + REST_SPREAD * rng.standard_normal(self.shape), 0)

    def idle(self) -> np.ndarray:
        """Return a frame without a contact."""
        return self._read(np.zeros(self.shape))

    def pressed(self, shape: str) -> np.ndarray:
        """Return a frame with a contact of ``shape``, one of CLASSES, anywhere on the pad."""
        rng = self._rng
        contact = self._placed(random_contact(rng, shape, np.exp(rng.uniform(*np.log(AREAS))), *self.shape))
        y, x = np.indices(self.shape)
        angle, radius = rng.uniform(0, 2 * np.pi), np.sqrt(contact.area / np.pi)
        rise = ((x - contact.x) * np.cos(angle) + (y - contact.y) * np.sin(angle)) / radius
        covered = coverage(contact, *self.shape)
        pressure = covered * (1 + rng.uniform(0, TILT) * rise)
        felt = ndimage.gaussian_filter(pressure, self._blur, mode='constant')
        felt = felt + self._halo(felt, ndimage.convolve(pressure, self._spread, mode='constant'), covered)
        return self._read(rng.uniform(*LEVEL) * felt / felt[covered >= 0.5].mean())

    def _placed(self, contact: Contact) -> Contact:
        (rows, cols), rng = self.shape, self._rng
        room_y, room_x = (max((size - 1) / 2 - contact.reach, 0.5) for size in (rows, cols))
        return replace(contact, y=(rows - 1) / 2 + rng.uniform(-room_y, room_y),
                       x=(cols - 1) / 2 + rng.uniform(-room_x, room_x))

    def _halo(self, felt: np.ndarray, spread: np.ndarray, covered: np.ndarray) -> np.ndarray:
        """Return the halo, so strong that the taxels next to the contact read the share ``beside`` of its level."""
        inside = covered >= 0.5
        around = grown(inside) & (covered == 0)
        wanted = self._beside * np.median(felt[inside])
        per_strength = np.median(spread[around]) - self._beside * np.median(spread[inside])
        return spread * (min(wanted / per_strength, MOST_HALO) if per_strength > 0 else MOST_HALO)

    def _read(self, felt: np.ndarray) -> np.ndarray:
        noise = NOISE * self._rng.standard_normal(self.shape)
        return np.clip(self.gains * felt + self.rest + noise, 0, 1)


def halo_of_taxel(reach: float) -> np.ndarray:
    """Return the halo of one taxel. The halo falls like the stress in a thick elastic layer."""
    most = int(np.ceil(4 * reach))
    y, x = np.mgrid[-most:most + 1, -most:most + 1]
    found: np.ndarray = (1 + (x * x + y * y) / reach ** 2) ** -1.5
    return found / found.sum()


class OfSkins(NamedTuple):
    """Results for one way of reading the frames, on skins with the same halo."""

    beside: float
    read: str    #: one of READINGS
    right: PercentRate  #: contacts recognised
    sure: PercentRate   #: contacts with a sure name
    wrong: PercentRate  #: contacts with a sure name that is wrong


#: Ways of reading the frames of a skin, by name. Each function takes the skin, its frames (one contact in each) and the
#: measured gains, and returns the pattern of each frame.
READINGS: dict[str, Callable[[HaloSkin, list[np.ndarray], np.ndarray], list[ContactPattern]]] = {
    'each frame alone': lambda skin, frames, gains: alone(frames),
    'an idle frame before each': lambda skin, frames, gains: after_idle(frames, skin.idle),
    'one stream': lambda skin, frames, gains: stream(frames),
    'tared': lambda skin, frames, gains: alone([frame - skin.rest for frame in frames]),
    'tared, with gains': lambda skin, frames, gains: alone([(frame - skin.rest) / gains for frame in frames])}


def measured(recogniser: Recogniser, skins: int, purpose: Purpose) -> Iterator[OfSkins]:
    """Yield the results for each halo and reading. Each of ``skins`` skins is pressed once with each of CLASSES."""
    for number, beside in enumerate(BESIDE):
        answers: dict[str, list[tuple[bool, bool]]] = {read: [] for read in READINGS}
        for k in range(skins):
            rng = seeded(SEEDS + 1000 * number + k, purpose)
            skin = HaloSkin(rng, beside)
            frames = [skin.pressed(shape) for shape in CLASSES]
            gains = skin.gains * np.exp(GAIN_ERROR * rng.standard_normal(skin.shape))
            for read, patterns_of in READINGS.items():
                for shape, pattern in zip(CLASSES, patterns_of(skin, frames, gains)):
                    found = recogniser.recognise(pattern)
                    is_sure = found.confidence >= SURE and found.shape.value in CLASSES
                    answers[read].append((found.shape.value == shape, is_sure))
        for read, of in answers.items():
            counts = (sum(counted) for counted in zip(*((right, sure, sure and not right) for right, sure in of)))
            yield OfSkins(beside, read, *(PercentRate(count, len(of)) for count in counts))


def table(found: list[OfSkins]) -> Table:
    of_all = Table('Skins with a halo', f'contacts of {AREAS[0]:g} to {AREAS[1]:g} taxels on pads of 128 to 384 '
                   f'taxels whose gains differ by {100 * GAINS:g} % (standard deviation of the logarithm); *beside* is '
                   "the reading next to the contact, in per cent of the contact's level; share recognised, share with "
                   f'a name of {SURE:g} or more, and share of wrong names among all contacts [%]; measured gains are '
                   f'wrong by {100 * GAIN_ERROR:g} %',
                   ['beside', 'frames read', 'contacts', 'recognised, %', 'sure, %', 'sure and wrong, %'])
    for one in found:
        of_all.add(f'{100 * one.beside:g}', one.read, one.right.total, one.right, one.sure, one.wrong)
    return of_all
