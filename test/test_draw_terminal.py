"""tools/draw_terminal.py: what stands where on the terminal is where the picture has it."""

import importlib.util
import sys
from pathlib import Path

import pytest
from PIL import Image

spec = importlib.util.spec_from_file_location('draw_terminal', Path(__file__).resolve().parents[1] /
                                              'tools/draw_terminal.py')
tool = importlib.util.module_from_spec(spec)
spec.loader.exec_module(tool)


def shown(screen):
    return [''.join(cell.text for cell in row).rstrip() for row in screen.cells]


@pytest.mark.parametrize(('output', 'expected'), [
    ('one\r\ntwo', ['one', 'two', '']), ('one\rt', ['tne', '', '']), ('a\nb', ['a', ' b', '']),
    ('1\r\n2\r\n3\r\n4', ['2', '3', '4']), ('12345678', ['12345', '678', '']),
    ('one\r\ntwo\r\n\x1b[2A\x1b[2Knew', ['new', 'two', '']), ('one\x1b[2D\x1b[K', ['o', '', '']),
    ('one\r\ntwo\x1b[1A\x1b[2D\x1b[J', ['o', '', '']),
    ('one\x1b[2J\x1b[Hx', ['x', '', '']), ('\x1b[?25lx\x1b[3;2Hy', ['x', '', ' y'])])
def test_the_screen_after_output(output, expected):
    screen = tool.Screen(cols=5, rows=3)
    screen.feed(output)
    assert shown(screen) == expected


def test_colours_are_those_of_xterm_and_end_with_a_reset():
    screen = tool.Screen(cols=4, rows=1)
    screen.feed('\x1b[48;5;196m \x1b[38;5;21mb\x1b[0mc')
    assert [(cell.ink, cell.paper) for cell in screen.cells[0][:3]] == [
        (tool.TEXT, '#ff0000'), ('#0000ff', '#ff0000'), (tool.TEXT, tool.BACKGROUND)]


CAST = [{'version': 2, 'width': 4, 'height': 3}, [1.0, 'o', '\x1b[48;5;196m \x1b[0m\r\n'], [1.1, 'i', 'ignored'],
        [2.0, 'o', '\x1b[1A\x1b[48;5;21m \x1b[0m\r\n']]


def test_a_picture_shows_each_state_for_its_time_and_the_same_cast_gives_the_same_bytes(tmp_path):
    for name in ('a.gif', 'b.gif'):
        tool.save(tmp_path / name, *tool.of_cast(CAST, rate=10))
    assert (tmp_path / 'a.gif').read_bytes() == (tmp_path / 'b.gif').read_bytes()
    with Image.open(tmp_path / 'a.gif') as picture:
        assert picture.n_frames == 2 and picture.height == tool.CELL[1] + 2 * tool.MARGIN
        middle = tool.MARGIN + 4, tool.MARGIN + 8
        assert picture.convert('RGB').getpixel(middle) == (255, 0, 0) and picture.info['duration'] == 1000
        picture.seek(1)
        assert picture.convert('RGB').getpixel(middle) == (0, 0, 255)


def test_a_picture_is_not_shown_half_drawn():
    cast = [*CAST, [3.0, 'o', 'a'], [3.001, 'o', 'b'], [3.03, 'o', 'c']]
    shown_then = [''.join(cell.text for cell in cells[1]) for cells, _ in tool.screens(cast, rate=1000)]
    assert [line.strip() for line in shown_then if line.strip()] == ['abc']


def test_pictures_of_files_become_one_in_their_order(tmp_path):
    for name, colour in (('1.png', 'red'), ('2.png', 'blue')):
        Image.new('RGB', (40, 20), colour).save(tmp_path / name)
    tool.save(tmp_path / 'x.webp', *tool.of_pictures([tmp_path / '1.png', tmp_path / '2.png'], width=20, period=0.5))
    with Image.open(tmp_path / 'x.webp') as picture:
        assert (picture.n_frames, picture.size) == (2, (20, 10))
        assert picture.convert('RGB').getpixel((9, 5)) == (255, 0, 0)


def test_a_program_is_recorded_on_a_terminal_of_its_size():
    cast = tool.recorded([sys.executable, '-c', 'import os, sys; print(os.get_terminal_size(), sys.stdout.isatty())'],
                         cols=33, rows=7, seconds=20)
    assert ''.join(event[2] for event in cast[1:]).split() == ['os.terminal_size(columns=33,', 'lines=7)', 'True']
