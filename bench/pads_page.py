"""The page of bench_pads.py: tables, growth, what saturates, what is reported."""

import math
import textwrap
from collections.abc import Sequence

from pads_cases import FORMS, Case
from pads_ledger import exponents
from pads_run import KEPT_UP, LATE, Row

QUANTITIES = {'CPU': lambda row: row.cpu, 'memory': lambda row: row.pss, 'latency p50': lambda row: row.p50,
              'latency p99': lambda row: row.p99}
COST = ('processes', 'buses', 'pads a bus', 'Hz', 'wire %', 'CPU % of a core', 'busiest process %', 'PSS MB', 'p50 ms',
        'p99 ms', 'shapes of those due %', 'SYNCs left out', 'sweeps skipped by devices', 'TPDOs lost', 'node outages',
        'frames left out', 'senders CPU %', 'sender late 99 % ms', 'consumer CPU %', 'others CPU %', 'idle %',
        'verdict')
LEDGER = ('processes', 'buses x pads, Hz', 'TPDOs on the wire', 'received', 'not taken, counted', 'used',
          'lost, counted', 'taxel frames', 'shapes', 'overtaken, dropped, skipped: counted', 'unaccounted',
          'at the consumer: shapes + left out + gaps')
COLUMNS = 120
FULL_CORE, FULL_WIRE = 0.75, 0.97  #: of a core (the threads of a process wait for the GIL), of the wire
NO_IDLE, OTHERS = 0.1, 0.2  #: of a core


def page(rows: Sequence[Row], left_out: Sequence[tuple[Case, str]], command: str, topics: Sequence[list],
         joined: Sequence[list]) -> str:
    """In Markdown; ``left_out``: cases that did not run, and why; of pads_topics.Carried, pads_discovery.Joined."""
    others = sorted(row.others_cpu for row in rows)
    lines = ['# Many pads, as measured', f'Written by `{command}`. Other processes of the machine used '
             f'{others[len(others) // 2]:.0%} of a core meanwhile (median of the rows), {others[-1]:.0%} at most.', '',
             'Latency: from the last TPDO of a sweep on the wire to its shape at the consumer. `not measured`: a '
             f'sender was later than {1e3 * LATE:g} ms (99 %); counts and CPU are right, latency and losses may be its '
             f'own. `saturated`: fewer than {KEPT_UP:.0%} of the shapes that are due. Pictured: `scale.png`.', '',
             '![CPU, memory and latency](scale.png)', '', '## Cost', '', *table(COST, map(_cost, rows)), '',
             '## Growth', '', 'Exponent of y = c pads^a buses^b at one rate over the rows that are measured and not '
             'saturated, with its 95 % interval.', '', *table(
                 ('processes', 'Hz', 'rows', 'quantity', 'with the pads of a bus', 'with the buses'), growth(rows)), '',
             '## What saturates first', '', *saturation(rows), '',
             '## Nothing lost in silence', '', 'From activation to deactivation, all buses of the row. Unaccounted: '
             'sent, not received, and counted by none.', '', *table(LEDGER, map(_ledger, rows)), '',
             *reported(rows), *(f'- Left out: {name(case)}: {reason}' for case, reason in left_out), '',
             *network(topics, joined)]
    return '\n'.join(part for line in lines for part in wrapped(line)).rstrip() + '\n'


def wrapped(line: str) -> list[str]:
    """Text in lines of 120 columns; tables and pictures as they are."""
    return [line] if line.startswith(('|', '!')) else textwrap.wrap(line, COLUMNS, subsequent_indent='  ' * (
        line.startswith('- '))) or ['']


def table(head: Sequence[str], rows) -> list[str]:
    return ['| ' + ' | '.join(row) + ' |' for row in (head, ['---'] * len(head), *rows)]


def name(case: Case) -> str:
    return f'{case.form}, {case.buses} x {case.pads} pads, {case.rate} Hz'


def verdict(row: Row) -> str:
    found = (['not measured: sender late'] if not row.is_measured else []) + (
        [f'saturated: {bottleneck(row)}'] if row.is_saturated else [])
    return '; '.join(found) or 'kept up'


def bottleneck(row: Row) -> str:
    """By what is full."""
    if row.wire_load > FULL_WIRE or row.counts.sweeps_skipped and row.is_measured:
        return 'wire'
    if row.busiest > FULL_CORE:
        return 'one process (GIL)'
    others = f', of which other work took {row.others_cpu:.0%} of a core' if row.others_cpu > OTHERS else ''
    return f'processors of the machine{others}' if row.idle < NO_IDLE else 'not CPU'


def growth(rows: Sequence[Row]) -> list[list[str]]:
    """Exponents of each quantity for each form."""
    found = []
    for form, rate in sorted({(row.case.form, row.case.rate) for row in rows}):
        of = [row for row in rows if row.case[::3] == (form, rate) and row.is_measured and not row.is_saturated]
        for quantity, value in QUANTITIES.items():
            fits = exponents([[row.case.pads, row.case.buses] for row in of], [value(row) for row in of])
            found.append([form, f'{rate}', f'{len(of)}', quantity, *map(str, fits or ('not measured',) * 2)])
    return found


def saturation(rows: Sequence[Row]) -> list[str]:
    """The smallest case of each form that is saturated, beside the largest that is not."""
    lines = []
    for form in FORMS:
        of = sorted((row for row in rows if row.case.form == form), key=lambda row: row.case.all_pads * row.case.rate)
        kept = [row for row in of if not row.is_saturated]
        full = [row for row in of if row.is_saturated]
        frames = kept[-1].case.all_pads * kept[-1].case.rate if kept else 0
        largest = f'the most that kept up: {frames} frames a second' if kept else 'none kept up'
        first = (f'first saturated: {name(full[0].case)}, by {bottleneck(full[0])}; reported: '
                 f'{_reports(full[0])}') if full else 'none saturated'
        lines += [f'- `{form}`: {largest}; {first}.'] if of else []
    return lines


def reported(rows: Sequence[Row]) -> list[str]:
    """What the saturated rows reported of themselves; silence would be a defect."""
    full = [row for row in rows if row.is_saturated]
    silent = [name(row.case) for row in full if not row.reported and not row.overloads]
    lost = [f'{name(row.case)} ({step.unaccounted}: {step.name})' for row in rows for step in row.steps
            if step.unaccounted > 0]
    return [f'- Saturated rows: {len(full)}; of these without any report: {", ".join(silent) or "none"}.',
            f'- Rows with anything unaccounted for: {", ".join(lost) or "none"}.']


def network(topics: Sequence[list], joined: Sequence[list]) -> list[str]:
    """Bytes of messages, and of discovery."""
    lines = ['## The network', '']
    if topics:
        lines += ['A gripper with two simulated pads at 50 Hz; bytes of the messages, without RTPS, UDP and IP. At the '
                  'full rate: what the rate would be without a frame left out.', '', *table(
                      ('topic', 'messages/s', 'mean bytes', 'most', 'kB/s at the full rate'),
                      ([topic, f'{rate:.1f}', f'{mean:.0f}', f'{most}', f'{_full_rate(topic, rate) * mean / 1e3:.0f}']
                       for topic, rate, mean, most in topics)), '']
    pairs = [(size, size * (size - 1) // 2) for size, _, _ in joined]
    if len(joined) > 1:
        lines += ['Grippers (one process of six nodes each) that join one DDS domain, over UDP on a network of their '
                  'own; bytes of discovery, all headers included.', '', *table(
                      ('grippers', 'kB when those joined', 'kB a new pair', 'then B/s', 'B/s by grippers squared'),
                      ([f'{size}', f'{joining / 1e3:.0f}', f'{joining / 1e3 / (all_pairs - before):.0f}',
                        f'{steady:.0f}', f'{steady / size ** 2:.0f}']
                       for (size, joining, steady), (_, all_pairs), (_, before) in zip(joined[1:], pairs[1:], pairs)))]
    return lines


def _full_rate(topic: str, rate: float) -> float:
    """The grasp is given for each shape of either pad."""
    if topic == 'grasp':
        return 100.0
    return rate if topic.startswith(('/', 'skin_driver')) else 50.0


def _reports(row: Row) -> str:
    parts = [f'overload {", ".join(row.overloads)}'] if row.overloads else []
    parts += [f'{who}: {", ".join(texts)}' for who, texts in row.reported.items()]
    return '; '.join(parts) or 'NOTHING'


def _cost(row: Row) -> list[str]:
    case, counts = row.case, row.counts
    return [case.form, f'{case.buses}', f'{case.pads}', f'{case.rate}', f'{100 * row.wire_load:.0f}',
            f'{100 * row.cpu:.0f}', f'{100 * row.busiest:.0f}', f'{row.pss:.0f}', _number(row.p50), _number(row.p99),
            f'{100 * row.kept_up:.1f}', f'{counts.syncs_left_out}', f'{counts.sweeps_skipped}', f'{counts.lost}',
            f'{counts.outages}', f'{counts.processor.overtaken + counts.classifier.overtaken}',
            f'{100 * row.sender_cpu:.0f}', _number(row.sender_late), f'{100 * row.consumer_cpu:.0f}',
            f'{100 * row.others_cpu:.0f}', f'{100 * row.idle:.0f}', verdict(row)]


def _ledger(row: Row) -> list[str]:
    case, counts = row.case, row.counts
    stations = counts.processor + counts.classifier
    steps = {step.name: step for step in row.steps}
    return [case.form, f'{case.buses} x {case.pads}, {case.rate}', f'{counts.tpdos * counts.sweeps}',
            f'{counts.received}', f'{steps["TPDO on the wire -> driver"].counted}', f'{counts.used}', f'{counts.lost}',
            f'{counts.published}', f'{counts.classifier.processed}',
            f'{stations.overtaken + stations.dropped + stations.skipped}', f'{row.unaccounted}',
            f'{row.shapes} + {row.left_out} + {row.gaps}']


def _number(value: float) -> str:
    return '-' if math.isnan(value) else f'{value:.1f}'
