"""Many pads on several buses: CPU, memory, latency, what saturates first, and whether anything is lost in silence.

    python bench/bench_pads.py [--full] [--seconds 10] [--only FORM] [--output docs]

Simulated skins are processes behind pseudo-terminals (slcan), one for each bus, and send each frame when a wire of
1 Mbit/s would have carried it; their CPU is apart, and a row whose sender was late is marked. Nodes run all in one
process, one process for each bus, or one for each node. Before and after each run the drivers are deactivated, so that
nothing is under way and every frame can be counted. At its end pads_topics.py and pads_discovery.py measure the
network. The default takes at most 15 minutes, --full about 45. Writes docs/scale_results.md and docs/scale.png; with
another --output it leaves docs/ alone.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ[f'{library}_NUM_THREADS'] = '1'  # read when numpy is imported
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

from bench_launch import wait_until_idle
from pads_cases import FORMS, FULL, GROWTH, MOST_PROCESSES, SHORT, Case
from pads_ledger import Counts, Station
from pads_page import name, page, verdict
from pads_picture import draw
from pads_run import Row, measured

MOST_TIME = 400.0  #: s of a run
RAW = ROOT / 'bench_output/pads.json'  #: all rows so far, for --again


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--full', action='store_true', help='all forms, buses, pads and rates')
    parser.add_argument('--seconds', type=float, default=10.0, help='of each measurement, default %(default)s')
    parser.add_argument('--only', choices=FORMS, help='this form of processes')
    parser.add_argument('--patience', type=float, default=10.0, help='longest wait for an idle machine [s]')
    parser.add_argument('--output', type=Path, default=ROOT / 'docs', help='folder, default docs/')
    parser.add_argument('--nice', type=int, default=0, help='priority of the nodes, below 0 as root (a busy machine)')
    parser.add_argument('--again', action='store_true', help=f'write the page of the rows in {RAW.name} again')
    parser.add_argument('--single', nargs=4, metavar=('FORM', 'BUSES', 'PADS', 'RATE'), help='one case, as JSON')
    args = parser.parse_args()
    if args.single:
        print(json.dumps(measured(_case(args.single), args.seconds, args.nice)))
        return 0
    cases = [case for case in (*GROWTH, *(FULL if args.full else SHORT)) if args.only in (None, case.form)]
    rows, left_out, begun = [], [], time.monotonic()
    if args.again:
        cases, rows = [], [row_of(fields) for fields in json.loads(RAW.read_text(encoding='utf-8'))]
    for number, case in enumerate(cases, 1):
        print(f'[{number}/{len(cases)}, {time.monotonic() - begun:.0f} s] {name(case)}: ', end='', flush=True)
        outcome = run(case, args.seconds, args.patience, args.nice)
        if isinstance(outcome, Row):
            rows.append(outcome)
            RAW.parent.mkdir(exist_ok=True)
            RAW.write_text(json.dumps(rows), encoding='utf-8')
            print(f'CPU {outcome.cpu:.0%}, {outcome.pss:.0f} MB, p50 {outcome.p50:.1f} ms, p99 {outcome.p99:.1f} ms, '
                  f'{outcome.kept_up:.1%} of the shapes, unaccounted {outcome.unaccounted}; {verdict(outcome)}',
                  flush=True)
        else:
            left_out.append((case, outcome))
            print(outcome, flush=True)
    print('what the topics carry, and what discovery costs', flush=True)
    topics, joined = printed_by('pads_topics.py'), printed_by('pads_discovery.py')
    command = 'python bench/bench_pads.py' + ''.join(f' {word}' for word in sys.argv[1:])
    args.output.mkdir(parents=True, exist_ok=True)
    (args.output / 'scale_results.md').write_text(page(rows, left_out, command, topics, joined), encoding='utf-8')
    draw(rows, args.output / 'scale.png')
    print(f'{args.output}/scale_results.md: {len(rows)} rows')
    return 0


def run(case: Case, seconds: float, patience: float, nice: int) -> Row | str:
    """In a separate process; or why there is no row."""
    if case.processes > MOST_PROCESSES:
        return f'{case.processes} processes of nodes, more than {MOST_PROCESSES} on {os.cpu_count()} cores'
    wait_until_idle(patience)
    words = [sys.executable, __file__, '--seconds', str(seconds), '--nice', str(nice), '--single', *map(str, case)]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        output, errors = process.communicate(timeout=MOST_TIME)
    except subprocess.TimeoutExpired:
        return f'no result within {MOST_TIME:g} s'
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)  # it ends what it has started
            process.communicate()
    if process.returncode:
        return (errors.strip().splitlines() or ['no message'])[-1]
    return row_of(json.loads(output.splitlines()[-1]))


def printed_by(script: str) -> list:
    """What another script prints, a JSON value a line; nothing where it fails (no namespaces)."""
    done = subprocess.run([sys.executable, str(ROOT / 'bench' / script)], stdout=subprocess.PIPE, text=True)
    return [json.loads(line) for line in done.stdout.splitlines()] if not done.returncode else []


def row_of(fields: list) -> Row:
    """From JSON, whose arrays are the tuples."""
    row = Row(*fields)
    counts = Counts(*row.counts[:-2], *(Station(*station) for station in row.counts[-2:]))
    return row._replace(case=Case(*row.case), counts=counts)


def _case(words: list[str]) -> Case:
    return Case(words[0], *map(int, words[1:]))


if __name__ == '__main__':
    sys.exit(main())
