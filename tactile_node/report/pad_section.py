"""One pad as HTML: what it is, its counts, its taxels."""

import numpy as np

from tactile_node.frames.fault_text import node_label
from tactile_node.frames.taxel_frame import TaxelStatus
from tactile_node.report.markup import Html, facts, folded, joined, legend_of, paragraph, safe, table
from tactile_node.report.model import Gap, PadFacts, TaxelHealth
from tactile_node.report.svg import cells, colour_bar, grid, heat_cells
from tactile_node.report.taxel_record import Mark, marks_of, no_value_share
from tactile_node.report.touch_section import reading, touch_section

MARKS = {Mark.GOOD: ('#2e8b57', 'values in every frame, which change'),
         Mark.NEVER_CHANGED: ('#b9d8c4', 'never changed (nor does an untouched, quiet taxel)'),
         Mark.SATURATED: ('#f2c14e', 'at the end of its range at times'),
         Mark.SOME_MISSING: ('#f78154', 'no value in some frames'),
         Mark.NO_VALUE: ('#8d3b72', 'no value in any frame'), Mark.FLICKERING: ('#5f7fff', 'flickers'),
         Mark.STUCK: ('#c1121f', 'stuck'), Mark.DEAD: ('#1d1d1d', 'dead'), Mark.UNMAPPED: ('#ececec', 'no taxel')}
WORST = 20  #: taxels listed


def pad_section(pad: PadFacts, begin: float, end: float) -> Html:
    parts = [Html(f'<h2>Pad {safe(pad.name)}</h2>'), _properties(pad)]
    if pad.are_of_others:
        return joined([*parts, _left_out(pad)])
    parts += [Html('<h3>Touches</h3>'), touch_section(pad, begin, end), Html('<h3>Taxels</h3>')]
    parts += [paragraph(None)] if pad.health is None else [_health(pad.health, pad.unit), _worst(pad.health)]
    return joined([*parts, folded(f'Gaps without a taxel frame ({pad.gap_count})', gap_table(pad.gaps, begin))])


def _left_out(pad: PadFacts) -> Html:
    found = pad.contradiction
    if found is None:
        return paragraph(f'Not heard: its nodes. Heard: {", ".join(map(str, pad.strangers))}, with some of the same '
                         'COB-IDs. The taxels may be of these and are left out. Give the right --node-id, or '
                         '--any-device.', 'problem')
    return paragraph(
        f'{node_label(found.pad, found.node_id)}, object 0x{found.object_index:04X}: expected {found.expected}, got '
        f'{found.got} by the SDO answers in the log. Its taxels would be in wrong places and are left out. Give the '
        'layout and EDS of the device that was recorded, or --any-device.', 'problem')


def gap_table(gaps: tuple[Gap, ...], begin: float) -> Html:
    return table(('after [s]', 'for [s]'), ((f'{gap.begin - begin:.3f}', f'{gap.seconds:.3f}') for gap in gaps))


def _properties(pad: PadFacts) -> Html:
    statistics = pad.statistics
    sent = None if statistics is None else (
        f'{statistics.expected} expected, {statistics.received} received, {statistics.used} used')
    lost = None if pad.losses is None else (
        ', '.join(f'{count} {reason.replace("_", " ")}' for reason, count in pad.losses) or 'none')
    period = None if pad.period is None else f'{1e3 * pad.period:.1f} ms'
    return facts([
        ('taxels', f'{pad.rows} x {pad.cols}, pitch {1e3 * pad.pitch:g} mm, values in {pad.unit}'),
        ('node-IDs', ', '.join(map(str, pad.node_ids)) or None), ('layout', pad.layout),
        ('SHA-256 of the layout', pad.layout_sha256),
        ('taxel frames', f'{pad.frames}, {pad.incomplete} of them incomplete, {pad.lost_frames} missing by their '
                         'sequence'),
        ('median period', period), ('TPDOs, or SDO uploads', sent), ('lost CAN frames by reason', lost)])


def _health(health: TaxelHealth, unit: str) -> Html:
    marks, share = marks_of(health), no_value_share(health)
    rows, cols = marks.shape
    top = float(np.nanmax(health.highest, initial=0.0))
    pictures = [('State', cells([(colour, marks == mark) for mark, (colour, _) in MARKS.items()]), ''),
                ('Highest value', heat_cells(health.highest, top), colour_bar(reading(top, unit)))]
    worst = float(np.nanmax(share, initial=0.0))
    if worst > 0:
        pictures.append(('Frames without a value', heat_cells(share, worst), colour_bar(f'{worst:.1%}')))
    legend = legend_of((colour, f'{text}: {(marks == mark).sum()}') for mark, (colour, text) in MARKS.items()
                       if (marks == mark).any())
    figures = ''.join(f'<figure><figcaption><b>{name}</b></figcaption>{grid(rows, cols, content, name)}{bar}</figure>'
                      for name, content, bar in pictures)
    return joined([legend, Html(f'<div class="cards">{figures}</div>'),
                   paragraph('Row 0 is at the bottom, column 0 at the left. Dead, stuck and flickering taxels are '
                             'found by what they send in several touches; without touches none is found.', 'note')])


def _worst(health: TaxelHealth) -> Html:
    """The taxels that most often had no value."""
    share = np.nan_to_num(no_value_share(health))
    marks = marks_of(health)
    odd = [place for place in np.argsort(-share, axis=None, kind='stable')
           if share.flat[place] > 0 or marks.flat[place] in (Mark.FLICKERING, Mark.STUCK, Mark.DEAD)]
    if not odd:
        return paragraph('Every taxel had a value in every frame.')
    rows = []
    for place in odd[:WORST]:
        row, col = divmod(int(place), share.shape[1])
        counts = ', '.join(f'{health.by_status[status, row, col]} {status.name.lower().replace("_", " ")}'
                           for status in TaxelStatus if health.by_status[status, row, col])
        rows.append((row, col, MARKS[Mark(int(marks.flat[place]))][1], f'{share.flat[place]:.1%}', counts))
    more = f' (the worst {WORST} of {len(odd)})' if len(odd) > WORST else f' ({len(odd)})'
    return folded('Taxels without a value, or faulty' + more,
                  table(('row', 'column', 'state', 'without a value', 'frames by status'), rows))
