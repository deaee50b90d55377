"""Write the results of the reproduction as a self-contained HTML page and as CSV files."""

import base64
import csv
import io
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from string import Template

from matplotlib.figure import Figure

from bench.reproduction import clouds, sketches
from bench.reproduction.experiments import Results
from bench.reproduction.methods import PUBLISHED, SIZES, Method
from bench.reproduction.wording import findings
from bench.reproduction.worlds import LONG_RECTANGLES
from tactile_node.learning.teach import Rate
from tactile_node.shape.volf import ANSWERS

Row = Sequence[str | int | float]

STYLE = '''body { font: 15px/1.5 sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #222 }
table { border-collapse: collapse; margin: 1em 0; font-size: 13px } td, th { padding: .25em .6em; text-align: right }
th { border-bottom: 1px solid #888; text-align: right } td:first-child, th:first-child { text-align: left }
tr.paper { color: #c2410c } tr:nth-child(even) { background: #f6f6f6 }
figure { display: inline-block; margin: 1em 1em 1em 0; vertical-align: top } figure.wide { display: block }
figcaption { font-size: 13px; color: #555; max-width: 44em } small { color: #777 }
td { white-space: nowrap } td:first-child { white-space: normal }'''
#: Name of the page in the output folder.
PAGE_FILE = 'index.html'
#: Names of the tables beside the page: rates by size, patterns that each plane loses, and confused classes.
TABLES = ('rates.csv', 'lost.csv', 'confusion.csv')
INTERVALS = 'Recognition rate with 95 % intervals (Wilson). Stars mark the published rates.'
PAGE = Template('''<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Volf, Dvořák, Vlček: re-drawn and re-measured</title>
<style>$style</style></head><body>
<h1>Volf, Dvořák, Vlček: re-drawn and re-measured</h1>
<p>The command <code>$command</code> computed every picture and every number on this page.</p>
<h2>Recognition rate by size</h2>
$rates
$chart
<h2>Findings</h2>
<ul>$findings</ul>
<h2>Share of patterns that each plane loses (as published)</h2>
$lost
<h2>Confusion (as published): share of each answer for each true class</h2>
<details><summary>At every size</summary>$confusions</details>
<h2>The figures</h2>
$figures
</body></html>
''')


def write_page(folder: Path, results: Results, command: str) -> list[Path]:
    """Write PAGE_FILE and TABLES into ``folder``, and return their paths."""
    lost, confusions = _lost_rows(results), _confusion_rows(results)
    page = PAGE.substitute(
        style=STYLE, command=escape(command), rates=_rate_table(results.methods), chart=_figure(
            clouds.rates_by_size(results.methods), INTERVALS, True),
        findings=''.join(f'<li>{escape(text)}</li>' for text in findings(results)),
        lost=_table(lost, percent=True), confusions=_table(confusions, percent=True), figures=_figures(results))
    (folder / PAGE_FILE).write_text(page, encoding='utf-8')
    tables = _rate_rows(results.methods), lost, confusions
    for name, rows in zip(TABLES, tables, strict=True):
        with open(folder / name, 'w', encoding='utf-8', newline='') as stream:
            csv.writer(stream).writerows(rows)
    return [folder / name for name in (PAGE_FILE, *TABLES)]


def _rate_rows(methods: Sequence[Method]) -> list[Row]:
    rows: list[Row] = [['method', 'area', 'recognised', 'low95', 'high95', 'patterns']]
    for method in methods:
        rows += [[method.name, size, rate.value, *rate.interval, rate.total]
                 for size, rate in method.rates.items()]
    return rows


def _lost_rows(results: Results) -> list[Row]:
    return [['area', 'plane 1', 'plane 2', 'plane 3', 'patterns with vanishing angles'],
            *([size, *results.lost[size].values(), results.vanished[size]] for size in SIZES)]


def _confusion_rows(results: Results) -> list[Row]:
    return [['true class', 'area', *(shape.value for shape in ANSWERS)],
            *([shape.value, size, *results.confusions[size][index].tolist()]
              for size in SIZES for index, shape in enumerate(ANSWERS))]


def _rate_table(methods: Sequence[Method]) -> str:
    rows = [_row('th', ['recognised', *(f'{size}' for size in SIZES)]),
            _row('td', ['the paper', *(PUBLISHED.get(size, '') for size in SIZES)], 'paper')]
    return f'<table>{"".join(rows + [_method_row(method) for method in methods])}</table>'


def _method_row(method: Method) -> str:
    def cell(rate: Rate) -> str:
        low, high = rate.interval
        return f'{rate.value:.1%}<br><small>{100 * low:.1f}-{100 * high:.1f}</small>'

    count = next(iter(method.rates.values())).total
    cells = ''.join(f'<td>{cell(rate)}</td>' for rate in method.rates.values())
    return f'<tr><td>{escape(method.name)}<br><small>{count} patterns per point</small></td>{cells}</tr>'


def _table(rows: list[Row], percent: bool) -> str:
    def shown(value: str | int | float) -> str:
        return f'{value:.1%}' if percent and isinstance(value, float) else str(value)

    return f'<table>{_row("th", rows[0])}{"".join(_row("td", map(shown, row)) for row in rows[1:])}</table>'


def _row(kind: str, cells: Iterable[object], style: str = '') -> str:
    return f'<tr class="{style}">' + ''.join(f'<{kind}>{escape(str(cell))}</{kind}>' for cell in cells) + '</tr>'


def _figures(results: Results) -> str:
    samples, planes = results.clouds, results.classifier.planes
    long = results.long_clouds, results.long_classifier.planes
    return ''.join(_figure(figure, caption) for figure, caption in (
        (sketches.discrete_circle(), 'Fig. 1. The discrete pattern of a circle.'),
        (sketches.circle_border(), 'Fig. 2. Border P05 (black) of the pattern of a circle.'),
        (sketches.centre_of_gravity(), 'Fig. 3. The centre of gravity of the normalised matrix A9 of a rectangle.'),
        (sketches.fictive_points(), 'Fig. 4. A triplet of taxels completed by fictive points.'),
        (sketches.hole_rules(), 'Fig. 5. Rules for holes: before (above), after (below).'),
        (clouds.first_plane(samples, planes), 'Fig. 6. dif α9 = f(N). Rectangles are above the solid curve, '
                                              'right triangles between the curves, all others below.'),
        (clouds.second_plane(samples, planes), 'Fig. 7. min I5 = f(min P05).'),
        (clouds.third_plane(samples, planes), f'Fig. 8. dif I5 = f({" ".join(planes["square"].horizontal)}).'),
        (clouds.first_plane(*long), 'Fig. 6 again, in a world with one aspect ratio per class and with '
                                    f'rectangles of {LONG_RECTANGLES.rectangle:g}:1.')))


def _figure(figure: Figure, caption: str, wide: bool = False) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format='svg', dpi=150, metadata={'Date': None})
    data = base64.b64encode(buffer.getvalue()).decode()
    return (f'<figure class="{"wide" if wide else ""}"><img src="data:image/svg+xml;base64,{data}" '
            f'alt="{escape(caption)}"><figcaption>{escape(caption)}</figcaption></figure>')
