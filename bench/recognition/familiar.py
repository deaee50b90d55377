"""Cases and tables of foreign figures, which must be UNKNOWN, and of known shapes with or without a blemish."""

from collections.abc import Callable, Iterator

import numpy as np

from bench.recognition import blemish, foreign
from bench.recognition.cases import Case, patches, seeded
from bench.recognition.contest import ORDER, OURS, Result, rejection_at_loss
from bench.recognition.figures import PercentRate
from bench.recognition.page import KIND, Table
from bench.recognition.stamp import Drawing, Stamp, pressed
from tactile_node import Shape, find_contact
from tactile_node.shape.recogniser import OUTPUTS
from tactile_node.simulator.world import CLASSES
from training.blemishes import BLEMISHES
from training.forms import EXTENT
from training.ground_truth.seeds import Purpose
from training.held_out import HELD_OUT
from training.shapes import Figure

FOREIGN_AREAS = (12, 20, 40, 50, 100, 200)
BLEMISH_AREAS = (40, 100, 200)
REJECTED = 0.98      #: Required share of foreign contacts that are UNKNOWN.
FROM_AREA = 40       #: Area from which REJECTED is required [taxels].
RECOGNISED = 0.9     #: Required share of blemished shapes that are recognised.
BLEMISHED_FROM = 100  #: Area from which RECOGNISED is required [taxels].
LABEL = {shape.value: k for k, shape in enumerate(OUTPUTS)}
UNKNOWN = OUTPUTS.index(Shape.UNKNOWN)
SEEDS = {'foreign': 400_000, 'blemish': 600_000, 'whole': 700_000}


def pressed_case(rng: np.random.Generator, name: str, stamps: list[Stamp], labels: list[int], *, on_off: bool,
                 area: float, count: int) -> Case:
    """Press the ``stamps`` in turn, ``count`` times in total, and let the library find the contacts."""
    chosen = np.arange(count) % len(stamps)
    patterns = [find_contact(pressed(stamps[k], rng, area, on_off), unit=None) for k in chosen]
    return Case(name, on_off, area, patterns, patches(patterns, np.array(labels)[chosen]))


def _cases(name: str, seed: int, stamps: list[Stamp], labels: list[int], areas: tuple[int, ...], count: int,
           purpose: Purpose) -> Iterator[Case]:
    for on_off in (True, False):
        for area in areas:
            rng = seeded(seed + 1000 * on_off + area, purpose)
            yield pressed_case(rng, name, stamps, labels, on_off=on_off, area=area, count=count)


def foreign_cases(figures: int, count: int, purpose: Purpose) -> Iterator[Case]:
    """Yield cases with ``figures`` figures of each family, pressed ``count`` times for each size and kind of frame.

    Validation uses other families, because no choice may depend on the reported families.
    """
    families = _validated(HELD_OUT) if purpose is Purpose.VALIDATION else foreign.FAMILIES
    for number, (family, drawing) in enumerate(families.items()):
        seed = SEEDS['foreign'] + 10_000 * number
        stamps = foreign.bank(seeded(seed, purpose), family, drawing, figures)
        yield from _cases(family, seed, stamps, [UNKNOWN] * figures, FOREIGN_AREAS, count, purpose)


def blemish_cases(figures: int, count: int, purpose: Purpose) -> Iterator[Case]:
    """Yield cases with ``figures`` figures per blemish and shape, pressed ``count`` times per size and kind of frame.

    Validation uses the blemishes of the training, because no choice may depend on the reported blemishes.
    """
    validated = _validated(BLEMISHES) if purpose is Purpose.VALIDATION else {}
    for number, kind in enumerate(validated or blemish.BLEMISHES):
        seed = SEEDS['blemish'] + 10_000 * number
        rng = seeded(seed, purpose)
        banks = [blemish.bank(rng, kind, validated.get(kind) or blemish.reported(kind, shape), shape, figures)
                 for shape in CLASSES]
        stamps = [stamp for of_all in zip(*banks) for stamp in of_all]
        yield from _cases(kind, seed, stamps, [LABEL[stamp.shape] for stamp in stamps], BLEMISH_AREAS, count, purpose)


def whole_cases(figures: int, count: int, purpose: Purpose) -> Iterator[Case]:
    """Yield cases of known shapes without a blemish, pressed like the foreign figures."""
    rng = seeded(SEEDS['whole'], purpose)
    stamps = [stamp for _ in range(figures) for stamp in map(lambda shape: blemish.whole(rng, shape), CLASSES)]
    labels = [LABEL[stamp.shape] for stamp in stamps]
    yield from _cases('known', SEEDS['whole'], stamps, labels, FOREIGN_AREAS, count, purpose)


def _validated(figures: dict[str, Figure]) -> dict[str, Drawing]:
    """Return the training's figures, scaled to the square of this module."""
    return {name: lambda rng, x, y, figure=figure: figure(rng, EXTENT * x, EXTENT * y)
            for name, figure in figures.items()}


def foreign_table(known: list[Result], results: list[Result]) -> Table:
    """Return the table of foreign figures, for the default settings and for limits that lose 2 % of known patterns."""
    table = Table('Foreign shapes', f'best overlap with any of the five below {foreign.FOREIGN}; share called unknown '
                  '[%] by ours as shipped, and by each contestant at a limit that loses 2 % of the known validation '
                  'patterns of the same size and kind of frame; for the anchors, the limit applies to the highest '
                  f'probability. Required: {100 * REJECTED:g} % as shipped from {FROM_AREA} taxels',
                  ['shape', 'frames', 'area', 'patterns', 'ours, as shipped', 'called a shape, > 0.9 sure',
                   *(f'{name}, 2 % loss' for name in results[0].answers), 'required'])
    for on_off, area, same in _by_size(results, FOREIGN_AREAS):
        limit = [r for r in known if (r.case.on_off, r.case.area) == (on_off, area)]
        for name, chosen in [*((r.case.condition, [r]) for r in same), ('all', same)]:
            right = _together(chosen, lambda r: r.right(OURS))
            sure = _together(chosen, lambda r: r.answers[OURS][:, :UNKNOWN].max(1) > 0.9)
            table.add(name, KIND[on_off], area, right.total, right, f'{100 * sure.value:.1f}',
                      *(rejection_at_loss(limit, chosen, contestant) for contestant in same[0].answers),
                      _verdict(right, REJECTED) if area >= FROM_AREA else '')
    return table


def blemish_table(results: list[Result]) -> Table:
    table = Table('Known shapes with a blemish', f'overlap with the shape {blemish.KEPT} to {1 - blemish.SPOILED:g}; '
                  f'share recognised, and share called unknown by ours [%]. Required: {100 * RECOGNISED:g} % from '
                  f'{BLEMISHED_FROM} taxels',
                  ['blemish', 'frames', 'area', 'patterns', *results[0].answers, 'ours unknown, %', 'required'])
    for on_off, area, same in _by_size(results, BLEMISH_AREAS):
        for name, chosen in [*((r.case.condition, [r]) for r in same), ('all', same)]:
            rates = [_together(chosen, lambda r, name=contestant: r.right(name)) for contestant in same[0].answers]
            table.add(name, KIND[on_off], area, rates[0].total, *rates, f'{100 * _unknown(chosen).value:.1f}',
                      _verdict(rates[0], RECOGNISED) if area >= BLEMISHED_FROM else '')
    return table


def _by_size(results: list[Result], areas: tuple[int, ...]) -> Iterator[tuple[bool, int, list[Result]]]:
    for on_off in (True, False):
        for area in areas:
            yield on_off, area, [r for r in results if (r.case.on_off, r.case.area) == (on_off, area)]


def _together(results: list[Result], right: Callable[[Result], np.ndarray]) -> PercentRate:
    chosen = np.concatenate([right(result) for result in results])
    return PercentRate(int(chosen.sum()), len(chosen))


def _unknown(results: list[Result]) -> PercentRate:
    return _together(results, lambda r: r.answers[OURS].argmax(1) == ORDER.index(Shape.UNKNOWN))


def _verdict(rate: PercentRate, least: float) -> str:
    return 'met' if rate.value >= least else 'NOT MET'
