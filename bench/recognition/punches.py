"""Computed contacts as cases of the contest: what the library sees of them without options."""

from collections.abc import Iterator

import numpy as np

from bench.recognition import mechanics
from bench.recognition.cases import ROUND, Case, patches
from tactile_node import find_contact
from tactile_node.simulator.world import Purpose

AREAS = (12, 25, 50, 100)
PUNCHES = 'flat punches'
FEWER = 10           #: times as many flat punches as other indenters
DEVELOPMENT = 500    #: a round that is never reported: the seeds while something is changed


def mechanics_cases(count: int, purpose: Purpose) -> Iterator[Case]:
    rounds = ROUND if purpose is Purpose.EVALUATION else DEVELOPMENT
    for number, (name, draw) in enumerate(mechanics.ROWS.items()):
        for area in AREAS:
            drawn = draw(area, count if name == PUNCHES else max(count // FEWER, 1),
                         1_000_000 * rounds + 1000 * number + area)
            patterns = [find_contact(frame, unit=None) for frame in drawn.frames]
            yield Case(name, False, area, patterns, patches(patterns, np.asarray(drawn.labels)))
