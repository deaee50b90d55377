"""Find conditions in which our method is worse than an anchor, with a test of each cell and with curves."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np

from bench.recognition.cases import Case, patches, seeded
from bench.recognition.contest import OURS, Contest, Result
from bench.recognition.figures import PercentRate, p_value_behind
from bench.recognition.page import KIND, Table
from bench.recognition.spots import Cell, cells, frame
from tactile_node import find_contact
from tactile_node.shape.recogniser import OUTPUTS
from training.ground_truth.seeds import Purpose

matplotlib.use('Agg')
import matplotlib.pyplot as plt  # noqa: E402

SEEDS = 800_000
BEHIND = 0.015    #: Largest allowed deficit of our method against the better anchor.
LEVEL = 0.001     #: Significance level for all cells together.
SHOWN = 12        #: Number of worst cells shown in the table.
NARROWEST = 1.0   #: Smallest range of an axis [%]. A smaller range would magnify the chance results of single patterns.
BESIDE = -0.12, 0.0, 0.12
#: Colours from Okabe and Ito, which people with any colour vision can distinguish.
STYLES = ({'color': '#0072b2', 'marker': 'o', 'linewidth': 2},
          {'color': '#d55e00', 'marker': 's', 'linewidth': 1, 'linestyle': '--'},
          {'color': '#009e73', 'marker': '^', 'linewidth': 1, 'linestyle': ':'})
LABELS = tuple(shape.value for shape in OUTPUTS)


class Measured(NamedTuple):
    """Measured result of one cell."""

    cell: Cell
    rates: dict[str, PercentRate]     #: rate of each contestant
    by_shape: dict[str, PercentRate]  #: rate of our method for each shape
    better: str                       #: the better anchor
    p_value: float                    #: p-value of "at most BEHIND worse than the better anchor", for this cell alone

    @property
    def gap(self) -> float:
        return self.rates[self.better].value - self.rates[OURS].value


def measured(contest: Contest, count: int, purpose: Purpose) -> Iterator[Measured]:
    """Yield the result of each cell, measured with ``count`` patterns."""
    for number, cell in enumerate(cells()):
        yield _of(cell, contest.run(_case(cell, count, seeded(SEEDS + number, purpose))))


def _case(cell: Cell, count: int, rng: np.random.Generator) -> Case:
    kinds = cell.kinds(count)
    patterns = [find_contact(frame(cell, kind, rng), unit=None) for kind in kinds]
    labels = np.array([LABELS.index(kind) for kind in kinds])
    return Case(f'{cell.curve}: {cell.label}', cell.on_off, 0, patterns, patches(patterns, labels))


def _of(cell: Cell, result: Result) -> Measured:
    rates = {name: result.rate(name) for name in result.answers}
    better = max((name for name in rates if name != OURS), key=lambda name: rates[name].value)
    ours, labels = result.right(OURS), result.case.labels
    by_shape = {LABELS[k]: PercentRate(int(ours[labels == k].sum()), int((labels == k).sum()))
                for k in np.unique(labels)}
    return Measured(cell, rates, by_shape, better, p_value_behind(ours, result.right(better), BEHIND))


def table(found: list[Measured]) -> Table:
    behind = [one for one in found if is_behind(one, len(found))]
    made = Table('Blind spots', f'{len(found)} cells of {found[0].rates[OURS].total} patterns each; {len(behind)} of '
                f'them are significantly (p < {LEVEL:g}, corrected for their number) more than {100 * BEHIND:g} points '
                f'below the better anchor (required: none). The table has the {SHOWN} worst cells; all cells are in '
                 'blind_spots.csv',
                 ['varied', 'value', 'frames', *(f'{name}, %' for name in found[0].rates), 'ours by shape, %',
                  'behind, points', 'p, corrected', 'required'])
    for one in sorted(found, key=lambda one: (one.p_value, -one.gap))[:max(SHOWN, len(behind))]:
        by_shape = ', '.join(f'{shape} {100 * rate.value:.1f}' for shape, rate in one.by_shape.items())
        made.add(one.cell.curve, one.cell.words, KIND[one.cell.on_off], *one.rates.values(), by_shape,
                 f'{100 * one.gap:.1f}', f'{min(1.0, one.p_value * len(found)):.2g}',
                 'NOT MET' if one in behind else 'met')
    return made


def is_behind(one: Measured, number: int) -> bool:
    """Return True if our method is significantly behind, with Bonferroni's correction for ``number`` cells."""
    return one.p_value * number < LEVEL


def write_spots(path: Path, found: list[Measured]) -> None:
    names = list(found[0].rates)
    with path.open('w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(['varied', 'value', 'frames', 'count', *names, *(f'ours_{shape}' for shape in LABELS[:-1]),
                         'better_anchor', 'p_value', 'p_corrected'])
        for one in found:
            by_shape = [f'{one.by_shape[shape].value:.5f}' if shape in one.by_shape else '' for shape in LABELS[:-1]]
            writer.writerow([one.cell.curve, one.cell.words, KIND[one.cell.on_off], one.rates[OURS].total,
                             *(f'{one.rates[name].value:.5f}' for name in names), *by_shape, one.better,
                             f'{one.p_value:.3g}', f'{min(1.0, one.p_value * len(found)):.3g}'])


def draw_curves(path: Path, found: list[Measured], columns: int = 3) -> None:
    """Draw a panel for each curve and kind of frame, with a ring where our method is significantly behind."""
    curves: dict[tuple[str, bool], list[Measured]] = {}
    for one in found:
        curves.setdefault((one.cell.curve, one.cell.on_off), []).append(one)
    ordered = sorted(curves.items(), key=lambda item: list(dict.fromkeys(key[0] for key in curves)).index(item[0][0]))
    rows = -(-len(ordered) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(3.9 * columns, 2.6 * rows), layout='constrained', squeeze=False)
    for axis, ((curve, on_off), of_curve) in zip(axes.flat, ordered):
        _draw(axis, of_curve, len(found))
        axis.set_title(f'{curve}; {KIND[on_off]}', fontsize=10)
    for axis in axes.flat[len(ordered):]:
        axis.axis('off')
    for axis in axes[:, 0]:
        axis.set_ylabel('recognised [%]', fontsize=9)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc='outside upper center', ncols=4, fontsize=10)
    figure.savefig(path, dpi=85)
    plt.close(figure)


def _draw(axis, of_curve: list[Measured], number: int) -> None:
    """Draw one curve, with the marks of the contestants side by side, because lines at 100 % would hide each other."""
    place = np.arange(len(of_curve))
    names = list(of_curve[0].rates)
    lowest = min(100 * one.rates[name].value for one in of_curve for name in names)
    for name, shift, style in zip(names, BESIDE, STYLES):
        shares = [100 * one.rates[name].value for one in of_curve]
        axis.plot(place + shift, shares, label=name, markersize=4.5, **style)
    behind = [k for k in place if is_behind(of_curve[k], number)]
    axis.plot(behind, [100 * of_curve[k].rates[OURS].value for k in behind], 'o', markersize=11, fillstyle='none',
              color='black', label='ours significantly behind')
    every = 1 + len(place) // 12
    axis.set_xticks(place[::every], [one.cell.label for one in of_curve][::every], fontsize=8)
    axis.set_xlim(-0.5, len(place) - 0.5)
    room = max(100 - lowest, NARROWEST)
    axis.set_ylim(100 - 1.08 * room, 100 + 0.08 * room)
    axis.ticklabel_format(axis='y', useOffset=False)
    axis.tick_params(axis='y', labelsize=8)
    axis.grid(alpha=0.3)
