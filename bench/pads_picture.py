"""The picture of bench_pads.py: CPU, memory and latency over the number of pads."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib
from pads_cases import FORMS
from pads_run import Row

matplotlib.use('Agg')
from matplotlib import pyplot

#: Okabe and Ito's colours, apart also by their marks
STYLES = {'one': ('#0072b2', 'o'), 'per_bus': ('#d55e00', 's'), 'per_node': ('#009e73', '^')}
LABELS = {'one': 'one process', 'per_bus': 'one a bus', 'per_node': 'one a node'}
PANELS = (('CPU of the nodes [cores]', lambda row: (row.cpu,)), ('memory, PSS [MB]', lambda row: (row.pss,)),
          ('last TPDO to shape, p50 and p99 [ms]', lambda row: (row.p50, row.p99)),
          ('shapes of those due [%]', lambda row: (100 * row.kept_up,)))


def draw(rows: Sequence[Row], path: Path) -> None:
    """At 50 Hz; open marks: the sender was late, or the nodes did not keep up."""
    figure, axes = pyplot.subplots(2, 2, figsize=(10, 7.5), sharex=True, layout='constrained')
    for axis, (label, values) in zip(axes.flat, PANELS):
        for row in sorted((row for row in rows if row.case.rate == 50), key=lambda row: row.case.all_pads):
            colour, mark = STYLES[row.case.form]
            is_good = row.is_measured and not row.is_saturated
            place = row.case.all_pads * (0.96, 1.0, 1.04)[FORMS.index(row.case.form)]
            for value in values(row):
                axis.plot(place, value, mark, color=colour, markerfacecolor=colour if is_good else 'none', markersize=6)
        axis.set(ylabel=label, xscale='log')
        axis.set_yscale('linear' if '%' in label else 'log')
        axis.grid(which='both', color='#dddddd', linewidth=0.6)
    pads = sorted({row.case.all_pads for row in rows})
    for axis in axes[1]:
        axis.set(xlabel='pads, on all buses together, 50 frames a second each')
        axis.set_xticks(pads, map(str, pads))
        axis.minorticks_off()
    handles = [pyplot.Line2D([], [], linestyle='', marker=mark, color=colour, label=LABELS[form])
               for form, (colour, mark) in STYLES.items()]
    handles.append(pyplot.Line2D([], [], linestyle='', marker='o', color='k', markerfacecolor='none',
                                 label='open: saturated, or the sender was late'))
    figure.legend(handles=handles, loc='outside upper center', ncols=4, frameon=False)
    figure.savefig(path, dpi=80)
    pyplot.close(figure)
