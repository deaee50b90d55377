"""`make hosts` ends with a table of all its parts: one fails, one hangs, or the user stops it."""

import os
import signal
import subprocess
import sys
import time

import hosts_parts
import link_catalogue
import pytest
from hosts_parts import Part

HANG = 'import subprocess, time; print("at row 3", flush=True); subprocess.Popen(["sleep", "987"]).wait()'
DEAF = f'import signal; signal.signal(signal.SIGINT, signal.SIG_IGN); {HANG}'


def python(name: str, code: str, usual: float = 20.0) -> Part:
    return Part(name, [sys.executable, '-c', code], usual)


def rows_of(printed: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip('|').split('|')] for line in printed.splitlines()
            if line.startswith('| ') and '---' not in line and 'result' not in line]


def test_a_part_that_fails_or_hangs_is_a_row_with_its_last_line(capsys, monkeypatch):
    monkeypatch.setattr(hosts_parts, 'GRACE', 0.5)
    sleeping = sum(map(is_sleeping, os.listdir('/proc')))
    fails = 'print("| 5 | **fails**: slow", flush=True); raise SystemExit("no link")'
    assert hosts_parts.run([python('good', 'print("fine")'), python('bad', fails),
                            python('hung', HANG, 0.7), python('deaf', DEAF, 0.7), python('last', '')]) == 1
    printed = capsys.readouterr().out
    assert printed.splitlines()[-1] == 'bad: | 5 | **fails**: slow'
    rows = rows_of(printed.partition('| part |')[2])
    assert [(name, result) for name, result, *_ in rows] == [
        ('good', 'passed'), ('bad', 'FAILED'), ('hung', 'HUNG'), ('deaf', 'HUNG'), ('last', 'passed')]
    assert (rows[0][3], rows[1][3], rows[3][3]) == ('fine', 'no link', 'at row 3')
    assert '[5/5] last' in printed and sum(map(is_sleeping, os.listdir('/proc'))) == sleeping


def is_sleeping(process: str) -> bool:
    try:
        with open(f'/proc/{process}/cmdline', 'rb') as file:
            return file.read() == b'sleep\x00987\x00'
    except OSError:
        return False


def test_ctrl_c_ends_with_the_table_too():
    program = ('import sys; sys.path.insert(0, "test"); import hosts_parts as h; h.GRACE = 0.5\n'
               f'part = lambda name, code: h.Part(name, [sys.executable, "-c", code], 60.0)\n'
               f'sys.exit(h.run([part("first", {HANG!r}), part("second", "")]))')
    process = subprocess.Popen([sys.executable, '-c', program], stdout=subprocess.PIPE, text=True, cwd=os.path.dirname(
        os.path.dirname(os.path.abspath(__file__))))
    read = ''
    while 'at row 3' not in read:
        read += process.stdout.readline()
    process.send_signal(signal.SIGINT)
    begin = time.monotonic()
    read += process.communicate(timeout=60)[0]
    assert process.returncode == 130 and time.monotonic() - begin < 30
    assert [(name, result) for name, result, *_ in rows_of(read)] == [('first', 'STOPPED'), ('second', 'not run')]


def test_each_part_is_a_program_that_exists():
    names = [part.name for part in hosts_parts.parts()]
    assert len(names) == len(set(names)) == 13
    for part in hosts_parts.parts():
        assert any(word.startswith(str(hosts_parts.HERE)) and os.path.isfile(word) for word in part.command)


@pytest.mark.parametrize('broken', [(), ('slow',), ('slow', 'believed held')])
def test_a_row_that_fails_gives_each_reason(broken, capsys):
    table = link_catalogue.Table('cut [s]')
    table.row(5.0, requires={name: name not in broken for name in ('slow', 'believed held')})
    row = capsys.readouterr().out.splitlines()[-1]
    assert table.wrong == bool(broken) and row.startswith('| 5.00 |')
    assert row.partition('**fails**: ')[2] == ', '.join(broken)
