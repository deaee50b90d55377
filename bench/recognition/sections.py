"""The sections of the report, each with its own tables.

Each section can run alone.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol

from bench.recognition import familiar, halo_skins, held, nothing, several, tables
from bench.recognition.cases import Case, clean_cases, field_cases, mechanics_cases, seeded
from bench.recognition.contest import OURS, Contest, Result
from bench.recognition.idle import IDLE
from bench.recognition.page import KIND, Table
from tactile_node import Recogniser
from training.ground_truth.seeds import Purpose

AREAS, FIELD_AREAS = (9, 12, 15, 20, 25, 35, 50, 75, 100), (20, 50, 100)
NOTHING_SEEDS = 900_000


class Amount(NamedTuple):
    """Amounts of data for one run."""

    share: float    #: share of the training samples used for the anchors
    epochs: int     #: number of epochs for training the CNN
    clean: int      #: number of patterns in a clean case
    field: int
    mechanics: int
    pads: int       #: number of pads of each kind with several contacts, and of skins with each halo
    figures: int    #: number of figures per family of foreign shapes; each blemished shape gets a quarter of them
    pressed: int    #: number of frames for each family and size
    sequences: int  #: number of idle sequences of each kind


FULL = Amount(share=0.3, epochs=4, clean=3000, field=400, mechanics=2000, pads=100, figures=100, pressed=400,
              sequences=nothing.ENOUGH)
QUICK = Amount(share=0.07, epochs=2, clean=300, field=60, mechanics=100, pads=20, figures=12, pressed=60,
               sequences=20)


class Clock(Protocol):
    def __call__(self, text: str) -> None: ...


class Run(NamedTuple):
    """The contestants and settings that all sections share in one run."""

    contest: Contest
    recogniser: Recogniser   #: recogniser with default settings
    amount: Amount
    purpose: Purpose
    clock: Clock

    def results(self, cases: Iterable[Case], what: str) -> list[Result]:
        found = []
        for case in cases:
            found.append(self.contest.run(case))
            self.clock(f'{what}: {case.condition}, {KIND[case.on_off]}, {case.area:g} taxels: '
                       f'ours {found[-1].rate(OURS)} %')
        return found


def clean(run: Run) -> list[Table]:
    results = run.results(clean_cases(AREAS, run.amount.clean, run.purpose), 'clean frames')
    rates = tables.rates('Clean frames', 'share recognised [%] with 95 % Wilson intervals; the verdict compares ours '
                         'with the interval of the better anchor', results)
    return [rates, tables.probabilities(results)]


def mechanics(run: Run) -> list[Table]:
    results = run.results(mechanics_cases(run.amount.mechanics, run.purpose), 'contact mechanics')
    return [tables.rates('Contact mechanics', 'computed frames of indenters on an elastic half-space; share that is '
                         'recognised without options [%]', results)]


def several_contacts(run: Run) -> list[Table]:
    found = []
    for one in several.cases(run.recogniser, run.amount.pads, run.purpose):
        found.append(one)
        run.clock(f'several contacts: {one.number} of {one.area} taxels, {one.gap:g} between: {one.together} %')
    return [several.table(found)]


def halo(run: Run) -> list[Table]:
    found = []
    for one in halo_skins.measured(run.recogniser, run.amount.pads, run.purpose):
        found.append(one)
        run.clock(f'halo: {100 * one.beside:g} % beside, {one.read}: {one.right} %')
    return [halo_skins.table(found)]


def held_contacts(run: Run) -> list[Table]:
    figures, pressed = max(2, run.amount.figures // 4), max(10, run.amount.pressed // 8)
    worlds = {'the five shapes': familiar.whole_cases(5 * figures, 10 * pressed, run.purpose),
              'other shapes': familiar.foreign_cases(figures, pressed, run.purpose)}
    found = []
    for contacts, cases in worlds.items():
        for one in held.measured(run.recogniser, contacts, cases, run.purpose):
            found.append(one)
            run.clock(f'held: {contacts}, {one.area:g} taxels, {one.after:g} s: {one.sure} % sure')
    return [held.table(found)]


def foreign(run: Run) -> list[Table]:
    known = run.results(familiar.whole_cases(5 * run.amount.figures, run.amount.clean, Purpose.VALIDATION),
                        'known shapes for the limits')
    results = run.results(familiar.foreign_cases(run.amount.figures, run.amount.pressed, run.purpose), 'foreign')
    return [familiar.foreign_table(known, results)]


def blemish(run: Run) -> list[Table]:
    figures = max(2, run.amount.figures // 4)
    results = run.results(familiar.blemish_cases(figures, run.amount.pressed, run.purpose), 'blemish')
    return [familiar.blemish_table(results)]


def idle(run: Run) -> list[Table]:
    found = []
    for number, kind in enumerate(IDLE):
        found.append(nothing.measured(seeded(NOTHING_SEEDS + number, run.purpose), kind,
                                      *nothing.library(run.recogniser), run.amount.sequences))
        run.clock(f'nothing: {kind}: {found[-1].called} % called a shape, {found[-1].longest:.2f} s on the topic')
    return [nothing.table(found)]


def field(run: Run) -> list[Table]:
    results = run.results(field_cases(FIELD_AREAS, run.amount.field, run.purpose), 'field conditions')
    rates = tables.rates('Field conditions', 'one condition differs from the nominal ones; UNKNOWN counts as not '
                         'recognised, and the anchors never answer UNKNOWN', results)
    return [rates]


def recordings(run: Run) -> list[Table]:
    return [tables.recordings(run.contest, run.recogniser)]


SECTIONS: dict[str, Callable[[Run], list[Table]]] = {
    'clean': clean, 'mechanics': mechanics, 'recordings': recordings, 'nothing': idle, 'foreign': foreign,
    'blemish': blemish, 'several': several_contacts, 'halo': halo, 'held': held_contacts, 'field': field}
WITHOUT_ANCHORS = frozenset({'nothing', 'several', 'halo', 'held'})
