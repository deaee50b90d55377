"""A command shows its progress to a user at a terminal.

Without a terminal, no progress is printed, and progress is never mixed with the results.
"""

import io

import pytest

from tactile_node.cli import progress
from tactile_node.cli.progress import count_progress, show_progress


class Terminal(io.StringIO):
    """A stream that claims to be a terminal."""

    def isatty(self):
        return True


def work():
    with count_progress('frames of a log', ' frames', total=4) as bar:
        bar.update(2)
    return list(show_progress('abc', 'x.npy', prints=True))


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    monkeypatch.setattr(progress, 'BAR_DELAY', 0)


def test_no_progress_is_shown_if_stderr_is_not_a_terminal(capsys):
    assert work() == ['a', 'b', 'c']
    assert capsys.readouterr() == ('', '')


def test_a_terminal_shows_how_much_is_done(monkeypatch, capsys):
    monkeypatch.setattr('sys.stderr', terminal := Terminal())
    assert work() == ['a', 'b', 'c']
    shown = terminal.getvalue()
    assert 'frames of a log' in shown and '2/4' in shown and 'x.npy' in shown
    assert capsys.readouterr().out == ''
