"""`make hosts`: runs its parts one after another, reports how far it is, and ends with a table whatever happens.

Each part has the time that it took on a machine with other work, and ends after LIMIT times that.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent
LIMIT = 3.0  # times the usual time of a part, after which it is hung
REPORT_PERIOD = 60.0  # s
GRACE = 20.0  # s that a part has to end its processes
FAILS = '**fails**'  # in a row of link_catalogue.py
PYTEST = [sys.executable, '-m', 'pytest', '-q', '-rfEs', '-p', 'no:cacheprovider']


class Part(NamedTuple):
    name: str
    command: Sequence[str]
    usual: float  #: s


class Outcome(NamedTuple):
    name: str
    result: str  #: passed, FAILED, HUNG, STOPPED or not run
    seconds: float
    last: str  #: line that it printed
    failing: Sequence[str] = ()  #: rows of its tables


def parts() -> list[Part]:
    def test(name: str, usual: float) -> Part:
        return Part(name, [*PYTEST, str(HERE / f'{name}.py')], usual)

    def catalogue(table: str, usual: float, split: str = '') -> Part:
        words = [table, *(('--split', split) if split else ())]
        return Part('_'.join(filter(None, (table, split))), [sys.executable, str(HERE / 'link_catalogue.py'), *words],
                    usual)
    splits = 'taxels', 'grasps'  # of link_bench.py, which needs ROS
    return [test('test_hosts', 420), test('test_other_version', 90), test('test_link', 60),
            test('test_clocks_apart', 180), Part('hosts_table', [sys.executable, str(HERE / 'hosts_table.py')], 300),
            *(catalogue('losses', 420, split) for split in splits),
            *(catalogue('cuts', 240, split) for split in splits),
            catalogue('readers', 300), catalogue('rates', 240)]


def run(all_parts: Sequence[Part]) -> int:
    """Run them; 0 when all have passed, 130 after Ctrl-C."""
    outcomes: list[Outcome] = []
    try:
        for number, part in enumerate(all_parts):
            left = sum(each.usual for each in all_parts[number:])
            print(f'\n[{number + 1}/{len(all_parts)}] {part.name}: about {part.usual / 60:.1f} min, at most '
                  f'{LIMIT * part.usual / 60:.1f}; left in all: about {left / 60:.0f} min', flush=True)
            outcomes.append(_run(part))
            if outcomes[-1].result == 'STOPPED':
                break
    finally:
        _print_table(outcomes, all_parts)
    results = {outcome.result for outcome in outcomes}
    return 130 if 'STOPPED' in results else int(results != {'passed'})


def _run(part: Part) -> Outcome:
    begin, lines, failing = time.monotonic(), [''], list[str]()
    process = subprocess.Popen(part.command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                               errors='replace', start_new_session=True)
    reader = threading.Thread(target=_pass_on, args=(process, lines, failing), daemon=True)
    reader.start()
    result = 'HUNG'
    try:
        while (left := begin + LIMIT * part.usual - time.monotonic()) > 0:
            try:
                result = 'FAILED' if process.wait(min(left, REPORT_PERIOD)) else 'passed'
                break
            except subprocess.TimeoutExpired:
                print(f'    {part.name}: {(time.monotonic() - begin) / 60:.1f} min', flush=True)
    except KeyboardInterrupt:
        result = 'STOPPED'
    _end(process)
    reader.join(1.0)  # what it left running may keep the pipe open
    return Outcome(part.name, result, time.monotonic() - begin, lines[-1], failing)


def _pass_on(process: subprocess.Popen, lines: list[str], failing: list[str]) -> None:
    for line in process.stdout or ():
        print(line, end='', flush=True)
        if line.strip():
            lines[:] = [line.strip()]
        if FAILS in line:
            failing.append(line.strip())


def _end(process: subprocess.Popen) -> None:
    """End it and all that it started; a second Ctrl-C does not keep it from that."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(GRACE)
        except subprocess.TimeoutExpired:
            pass
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    process.wait()
    signal.signal(signal.SIGINT, before)


def _print_table(outcomes: Sequence[Outcome], all_parts: Sequence[Part]) -> None:
    not_run = [Outcome(part.name, 'not run', 0.0, '') for part in all_parts[len(outcomes):]]
    print('\n| part | result | min | its last line |\n| --- | --- | --- | --- |')
    for name, result, seconds, last, _ in (*outcomes, *not_run):
        print(f'| {name} | {result} | {seconds / 60:.1f} | {last} |')
    for outcome in outcomes:
        for row in outcome.failing:
            print(f'{outcome.name}: {row}')
    sys.stdout.flush()


if __name__ == '__main__':
    os.environ['TACTILE_LONG'] = '1'
    sys.exit(run([part for part in parts() if not sys.argv[1:] or part.name in sys.argv[1:]]))
