"""Several contacts on one pad, each recognised by itself: computed flat punches beside each other.

Each punch is solved alone and their stresses are added: how much one pushes up the skin under another is left out.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from bench.recognition import mechanics
from bench.recognition.cases import seeded
from bench.recognition.figures import Rate
from bench.recognition.page import Table
from tactile_node import Recogniser, find_contact
from tactile_node.contact.pattern import of_contact
from tactile_node.shape.recogniser import OUTPUTS
from tactile_node.synthetic.layer import measured, sample, stress_field
from tactile_node.synthetic.seeds import Purpose

SEEDS = 950_000
NUMBERS, AREAS, GAPS = (2, 3), (25, 50, 100), (4.0, 8.0)  #: punches on a pad, taxels of each, pitches between them
WEAKEST = 0.5   #: pressure of a punch relative to the strongest one's
ROOM = 5.0      #: around the punches [pitches]
STEP = 0.25     #: in which a punch is moved away from the others [pitches]
LABELS = [shape.value for shape in OUTPUTS]


class Pad(NamedTuple):
    """One pad with all its punches, and the same punches one by one."""

    together: np.ndarray  #: (rows, cols), fractions of full scale, NaN where dead
    alone: np.ndarray     #: (K, rows, cols)
    under: np.ndarray     #: bool, (K, rows, cols): taxels well under each punch
    labels: list[str]


class Several(NamedTuple):
    """What became of the punches of one kind of pad."""

    number: int
    area: int
    gap: float
    apart: Rate     #: punches with a contact that no other punch has
    together: Rate  #: recognised
    alone: Rate     #: recognised where nothing else presses the pad


def cases(recogniser: Recogniser, pads: int, purpose: Purpose) -> Iterator[Several]:
    """``pads`` of each number of punches, area and gap."""
    for number in NUMBERS:
        for area in AREAS:
            for gap in GAPS:
                rng = seeded(SEEDS + 10_000 * number + 100 * area + int(gap), purpose)
                yield _measured(recogniser, [draw(rng, number, area, gap) for _ in range(pads)], number, area, gap)


def table(found: list[Several]) -> Table:
    of_all = Table('Several contacts on a pad', 'computed flat punches of any of the five shapes, each of the given '
                   f'area, the weakest pressed with {WEAKEST:g} to 1 of the strongest: punches that have a contact of '
                   'their own, and that are recognised [%], beside the same punches alone on the pad',
                   ['punches', 'area', 'pitches between', 'punches in all', 'apart, %', 'recognised, %', 'alone, %'])
    for one in found:
        of_all.add(one.number, one.area, f'{one.gap:g}', one.apart.count, one.apart, one.together, one.alone)
    return of_all


def draw(rng: np.random.Generator, number: int, area: float, gap: float) -> Pad:
    """Draw a pad: each punch is moved away from those before it until ``gap`` is between them."""
    classes = rng.integers(len(LABELS) - 1, size=number)
    solutions = [mechanics.solved(*mechanics.random_punch(rng, int(k)), rng.uniform(0, 2 * np.pi)) for k in classes]
    angles, outlines = rng.uniform(0, 2 * np.pi, number), []
    origins = []
    for solution, angle in zip(solutions, angles):
        outline, origin = _dense(mechanics.turned(solution.outline, angle) * np.sqrt(area)), np.zeros(2)
        towards = rng.uniform(0, 2 * np.pi)
        while outlines and _distance(outline + origin, np.concatenate(outlines)) < gap:
            origin = origin + STEP * np.array((np.cos(towards), np.sin(towards)))
        outlines.append(outline + origin)
        origins.append(origin)
    points = np.concatenate(outlines)
    cols, rows = np.ceil(np.ptp(points, 0) + 2 * ROOM).astype(int)
    places = np.array(origins) - points.min(0) + ROOM + rng.uniform(-0.5, 0.5, 2)
    depth, pressures = rng.uniform(*mechanics.DEPTH), rng.uniform(WEAKEST, 1, number) * rng.uniform(*mechanics.PRESSURE)
    stresses = np.array([sample(stress_field(solution, area, depth), x, y, angle, rows, cols)
                         for solution, angle, (x, y) in zip(solutions, angles, places)])
    pressed = stresses * pressures[:, np.newaxis, np.newaxis]
    frames = [measured(one, 1.0, rng, noise=mechanics.NOISE, dead=mechanics.DEAD) for one in (pressed.sum(0), *pressed)]
    return Pad(frames[0], np.array(frames[1:]), stresses >= 0.6, [solution.label for solution in solutions])


def _dense(corners: np.ndarray) -> np.ndarray:
    """Points on the edges of a polygon, ten on each or more."""
    share = np.linspace(0, 1, 40 if len(corners) < 9 else 2, endpoint=False)[:, np.newaxis, np.newaxis]
    return (corners * (1 - share) + np.roll(corners, -1, 0) * share).reshape(-1, 2)


def _distance(points: np.ndarray, others: np.ndarray) -> float:
    return float(np.hypot(*(points[:, np.newaxis] - others).transpose(2, 0, 1)).min())


def _measured(recogniser: Recogniser, pads: list[Pad], number: int, area: int, gap: float) -> Several:
    apart, together, alone = [], [], []
    for pad in pads:
        pattern = find_contact(pad.together, unit=None)
        # The contact that most of the taxels under a punch belong to; as the classifier node looks at each.
        counted = [np.bincount(pattern.labels[under], minlength=2)[1:] for under in pad.under]
        contacts = [int(counts.argmax()) + 1 if counts.any() else 0 for counts in counted]
        for contact, label, frame in zip(contacts, pad.labels, pad.alone):
            is_own = contact > 0 and contacts.count(contact) == 1
            apart.append(is_own)
            one = of_contact(pattern, contact)._replace(contacts=1) if contact > 1 else pattern
            together.append(is_own and recogniser.recognise(one).shape.value == label)
            alone.append(recogniser.recognise(find_contact(frame, unit=None)).shape.value == label)
    rates = [Rate(int(sum(each)), len(each)) for each in (apart, together, alone)]
    return Several(number, area, gap, *rates)
