"""The bus as HTML: load, gaps, NMT commands, and what the driver reported."""

import numpy as np

from tactile_node.frames.fault_text import command_text
from tactile_node.frames.health import ForeignCommand
from tactile_node.report.charts import Points, chart, thinned
from tactile_node.report.markup import Html, facts, folded, joined, paragraph, table
from tactile_node.report.model import BusFacts, BusLoad
from tactile_node.report.pad_section import gap_table

LOAD = '#0072b2'


def bus_section(bus: BusFacts, begin: float, end: float) -> Html:
    parts = [Html('<h2>Bus</h2>'), facts([('channel', ', '.join(bus.channels) or None)]), Html('<h3>Load</h3>')]
    parts.append(paragraph(None) if bus.load is None else _load(bus.load, begin, end))
    parts.append(Html('<h3>CAN frames by service</h3>'))
    parts.append(paragraph(None) if bus.can_frames is None else table(
        ('service', 'CAN frames'), sorted(bus.can_frames.items())))
    parts.append(Html('<h3>Gaps without any CAN frame</h3>'))
    if bus.gaps is None:
        parts.append(paragraph(None))
    elif not bus.gaps:
        parts.append(paragraph('None of half a second or longer.'))
    else:
        parts.append(folded(f'{bus.gap_count} of half a second or longer, the {len(bus.gaps)} longest',
                            gap_table(bus.gaps, begin), is_open=len(bus.gaps) <= 5))
    parts.append(Html('<h3>NMT commands</h3>'))
    if bus.commands is None:
        parts.append(paragraph(None))
    else:
        rows = [(f'{each.stamp - begin:.3f}', command_text(ForeignCommand(each.command, each.node_id)))
                for each in bus.commands]
        parts.append(folded(f'Commands: {shown(bus.command_count, len(rows))}', table(('at [s]', 'command'), rows),
                            is_open=0 < len(rows) <= 10))
    if bus.reported is not None:
        parts += [Html('<h3>Reported by the driver</h3>'),
                  table(('at [s]', 'change'), ((f'{each.stamp - begin:.3f}', each.text) for each in bus.reported))
                  if bus.reported else paragraph('No warning, error or change.')]
    return joined(parts)


def shown(count: int | None, listed: int) -> str:
    """How many there are, and how many are listed."""
    return f'{count}' if count == listed else f'{count}, of which the first and last {listed} are listed'


def _load(load: BusLoad, begin: float, end: float) -> Html:
    if load.shares is not None:
        values, unit, text = 100 * load.shares, '%', f'mean {load.mean:.1%}, at most {load.shares.max():.1%}'
    else:
        assert load.bit_rates is not None
        values, unit = load.bit_rates / 1e3, 'kbit/s'
        text = (f'mean {load.mean / 1e3:.1f} kbit/s, at most {values.max():.1f} kbit/s. The bit rate is not in this '
                'recording; with --bitrate the load is a share of it')
    keep = thinned(values, keep_highest=True)
    line = Points(LOAD, load.stamps[keep] - begin + load.window / 2, values[keep])
    return joined([Html(chart([line], [], end=end - begin, top=1.1 * float(np.max(values, initial=0.0)), unit=unit)),
                   paragraph(f'Over {load.window:g} s, with bit stuffing at its worst: {text}.', 'note')])
