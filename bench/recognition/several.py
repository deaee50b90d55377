"""Measure the recognition of several contacts on one pad, each recognised separately as in the classifier node."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from bench.recognition.beside import WEAKEST, Pad, draw
from bench.recognition.cases import seeded
from bench.recognition.figures import PercentRate
from bench.recognition.page import Table
from tactile_node import Recogniser, find_contact
from tactile_node.contact.pattern import of_contact
from training.ground_truth.seeds import Purpose

SEEDS = 950_000
NUMBERS = (2, 3)       #: Numbers of punches on a pad.
AREAS = (25, 50, 100)  #: Areas of each punch [taxels].
GAPS = (4.0, 8.0)      #: Distances between punches [pitches].


class Several(NamedTuple):
    """Results for all punches on pads of one kind."""

    number: int
    area: int
    gap: float
    apart: PercentRate     #: punches found as separate contacts
    together: PercentRate  #: punches recognised on the shared pad
    alone: PercentRate     #: punches recognised alone on the pad


def cases(recogniser: Recogniser, pads: int, purpose: Purpose) -> Iterator[Several]:
    """Yield the results for each number of punches, area and gap, each measured on ``pads`` pads."""
    for number in NUMBERS:
        for area in AREAS:
            for gap in GAPS:
                rng = seeded(SEEDS + 10_000 * number + 100 * area + int(gap), purpose)
                yield _measured(recogniser, [draw(rng, number, area, gap) for _ in range(pads)], number, area, gap)


def table(found: list[Several]) -> Table:
    of_all = Table('Several contacts on a pad', 'computed flat punches of any of the five shapes with the given area; '
                   f'the weakest presses with {WEAKEST:g} to 1 times the pressure of the strongest; share of punches '
                   'with a contact of their own, share recognised, and share recognised alone on the pad [%]',
                   ['punches', 'area', 'pitches between', 'punches in all', 'apart, %', 'recognised, %', 'alone, %'])
    for one in found:
        of_all.add(one.number, one.area, f'{one.gap:g}', one.apart.total, one.apart, one.together, one.alone)
    return of_all


def _measured(recogniser: Recogniser, pads: list[Pad], number: int, area: int, gap: float) -> Several:
    apart, together, alone = [], [], []
    for pad in pads:
        pattern = find_contact(pad.together, unit=None)
        # A punch belongs to the contact that contains most of the taxels under the punch.
        counted = [np.bincount(pattern.labels[under], minlength=2)[1:] for under in pad.under]
        contacts = [int(counts.argmax()) + 1 if counts.any() else 0 for counts in counted]
        for contact, label, frame in zip(contacts, pad.labels, pad.alone):
            is_own = contact > 0 and contacts.count(contact) == 1
            apart.append(is_own)
            one = of_contact(pattern, contact)._replace(contacts=1) if contact > 1 else pattern
            together.append(is_own and recogniser.recognise(one).shape.value == label)
            alone.append(recogniser.recognise(find_contact(frame, unit=None)).shape.value == label)
    rates = [PercentRate(int(sum(each)), len(each)) for each in (apart, together, alone)]
    return Several(number, area, gap, *rates)
