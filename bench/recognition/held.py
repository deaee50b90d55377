"""Measure how often a contact that is held in place has a right, a sure and a sure but wrong name.

The frames of a contact differ only in their noise. The contact's own errors, such as the gains of its taxels, are the
same in all frames. The nodes fuse the frames.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from bench.recognition.cases import Case, seeded
from bench.recognition.figures import PercentRate
from bench.recognition.page import Table
from tactile_node import ContactStream, Recogniser
from tactile_node.learning.assess import NAMELESS
from tactile_node.shape.recognition import Recognition, Shape
from tactile_node.shape.support import SURE
from training.ground_truth.seeds import Purpose
from training.samples import LABELS, UNKNOWN

AREAS = (20, 50, 100)
PERIOD = 0.02               #: [s]
MOMENTS = (0.0, 0.1, 0.5)   #: Times after the first frame at which the fused name is counted [s].
NOISE = 0.03                #: Standard deviation of the noise [fraction of the largest value].
SEEDS = 850_000


class OfHeld(NamedTuple):
    """Results for one group of contacts at one time after the first frame."""

    contacts: str
    area: float
    after: float        #: time after the first frame [s]
    right: PercentRate
    sure: PercentRate   #: contacts with a name at a confidence of SURE or more
    wrong: PercentRate  #: contacts with such a name that is wrong


def measured(recogniser: Recogniser, contacts: str, cases: Iterable[Case], purpose: Purpose) -> Iterator[OfHeld]:
    """Yield the results for all ``cases`` with pressures and one of AREAS together, for each area and moment."""
    counted: dict[tuple[float, float], list[tuple[bool, bool, bool]]] = {}
    for number, case in enumerate(cases):
        if case.on_off or case.area not in AREAS:
            continue
        rng = seeded(SEEDS + number, purpose)
        for pattern, label in zip(case.patterns, case.labels):
            truth = Shape.UNKNOWN if label == UNKNOWN else Shape(LABELS[label])
            for moment, found in zip(MOMENTS, _held(recogniser, pattern.values, rng)):
                is_right = found.shape is truth or truth is Shape.UNKNOWN and found.shape is Shape.NONE
                is_sure = found.shape not in NAMELESS and found.confidence >= SURE
                counted.setdefault((case.area, moment), []).append((is_right, is_sure, is_sure and not is_right))
    for (area, moment), each in sorted(counted.items()):
        yield OfHeld(contacts, area, moment, *(PercentRate(sum(column), len(each)) for column in zip(*each)))


def _held(recogniser: Recogniser, values: np.ndarray, rng: np.random.Generator) -> list[Recognition]:
    """Return the fused recognition at each of MOMENTS, while the contact with these ``values`` is held."""
    stream, noise = ContactStream(recogniser, unit=None), NOISE * float(np.nanmax(values))
    frames = [values + noise * rng.standard_normal(values.shape) for _ in range(round(MOMENTS[-1] / PERIOD) + 1)]
    fused = [stream.update(frame, PERIOD * k).fused.recognition for k, frame in enumerate(frames)]
    return [fused[round(moment / PERIOD)] for moment in MOMENTS]


def table(found: Iterable[OfHeld]) -> Table:
    made = Table('Held contacts', f'contacts with pressures that are held in place, with {100 * NOISE:g} % noise in '
                 f'each frame at {1 / PERIOD:g} Hz; share with the right name, share with a name of {SURE:g} or more, '
                 'and share of wrong names among all contacts, as fused until then [%]',
                 ['contacts', 'area', 'after, s', 'number', 'right, %', 'sure, %', 'sure and wrong, %'])
    for one in found:
        made.add(one.contacts, f'{one.area:g}', f'{one.after:g}', one.right.total, one.right, one.sure, one.wrong)
    return made
