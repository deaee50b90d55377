"""Makes a moving picture of what a program shows on a terminal, or of pictures, for a page.

    python tools/draw_terminal.py docs/terminal.gif --run tactile demo --force --areas 40 60     # keep the cast too
    python tools/draw_terminal.py docs/terminal.gif --cast terminal.cast                 # draw a cast again
    python tools/draw_terminal.py docs/view.gif --pictures shot1.png shot2.png shot3.png

A cast is an asciicast v2 file (https://docs.asciinema.org/manual/asciicast/v2/): the same cast gives the same bytes.
The suffix of the picture chooses the format: .gif, .webp or .png (animated).
"""

import argparse
import fcntl
import json
import os
import pty
import re
import struct
import subprocess
import termios
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from matplotlib import get_data_path
from PIL import Image, ImageDraw, ImageFont

FONT = Path(get_data_path()) / 'fonts/ttf/DejaVuSansMono.ttf'
FONT_SIZE, CELL, MARGIN = 13, (8, 16), 8  #: [pixels]
BASE = ('#000000', '#cd0000', '#00cd00', '#cdcd00', '#3b78ff', '#cd00cd', '#00cdcd', '#e5e5e5',
        '#7f7f7f', '#ff0000', '#00ff00', '#ffff00', '#5c5cff', '#ff00ff', '#00ffff', '#ffffff')
LEVELS = 0, 95, 135, 175, 215, 255  #: of the colour cube of xterm-256
BACKGROUND, TEXT = '#16161d', '#dcdcdc'
COMMAND = re.compile(r'\x1b\[([?\d;]*)([A-Za-z])')
LAST = 3.0  #: for how long the last picture stays [s]
QUIET = 0.04  #: between two redrawings [s]
LARGEST = 1_000_000  #: [bytes] of a picture on a page


class Cell(NamedTuple):
    """One character and its colours."""

    text: str = ' '
    ink: str = TEXT
    paper: str = BACKGROUND


class Screen:
    """What a terminal shows after some output: printing, colours, and the movements that redrawing in place takes."""

    def __init__(self, cols: int, rows: int):
        self.cells = [[Cell()] * cols for _ in range(rows)]
        self._cols, self._rows = cols, rows
        self._x = self._y = 0
        self._blank = Cell()

    def feed(self, output: str) -> None:
        """Take the output of the program, whole escape sequences."""
        at = 0
        while at < len(output):
            if match := COMMAND.match(output, at):
                self._command(match[1], match[2])
                at = match.end()
            else:
                self._print(output[at])
                at += 1

    def _print(self, character: str) -> None:
        if character == '\r':
            self._x = 0
        elif character == '\n':
            self._next_line()
        elif character >= ' ':
            if self._x == self._cols:
                self._x = 0
                self._next_line()
            self.cells[self._y][self._x] = self._blank._replace(text=character)
            self._x += 1

    def _next_line(self) -> None:
        if self._y + 1 < self._rows:
            self._y += 1
        else:
            self.cells = [*self.cells[1:], [Cell()] * self._cols]

    def _command(self, given: str, kind: str) -> None:
        numbers = [int(number) for number in given.split(';') if number.isdecimal()]
        step = numbers[0] if numbers else 1
        if kind in 'AB':
            self._y = min(max(self._y + (step if kind == 'B' else -step), 0), self._rows - 1)
        elif kind in 'CD':
            self._x = min(max(self._x + (step if kind == 'C' else -step), 0), self._cols - 1)
        elif kind == 'H':
            self._y, self._x = (min(number, most) - 1 for number, most in
                                zip((*numbers, 1, 1), (self._rows, self._cols)))
        elif kind == 'K':
            first, last = {0: (self._x, self._cols), 1: (0, self._x + 1)}.get(numbers[0] if numbers else 0,
                                                                            (0, self._cols))
            self.cells[self._y][first:last] = [Cell()] * (last - first)
        elif kind == 'J' and not (numbers and numbers[0]):  # from here to the end
            self.cells[self._y][self._x:] = [Cell()] * (self._cols - self._x)
            self.cells[self._y + 1:] = [[Cell()] * self._cols for _ in range(self._y + 1, self._rows)]
        elif kind == 'J':
            self.cells = [[Cell()] * self._cols for _ in range(self._rows)]
        elif kind == 'm':
            self._colour(numbers or [0])

    def _colour(self, numbers: list[int]) -> None:
        while numbers:
            number = numbers.pop(0)
            if number == 0:
                self._blank = Cell()
            elif number in (38, 48) and numbers[:1] == [5]:
                self._blank = self._blank._replace(**{'ink' if number == 38 else 'paper': xterm(numbers[1])})
                del numbers[:2]
            elif 30 <= number <= 37 or 90 <= number <= 97:
                self._blank = self._blank._replace(ink=xterm(number % 10 + 8 * (number >= 90)))
            elif 40 <= number <= 47:
                self._blank = self._blank._replace(paper=xterm(number - 40))


def xterm(number: int) -> str:
    """Return a colour of xterm's 256 as #rrggbb.

    >>> xterm(231), xterm(16), xterm(232)
    ('#ffffff', '#000000', '#080808')
    """
    if number < 16:
        return BASE[number]
    if number < 232:
        number -= 16
        parts = [LEVELS[number // 36], LEVELS[number // 6 % 6], LEVELS[number % 6]]
    else:
        parts = 3 * [8 + 10 * (number - 232)]
    return '#' + ''.join(f'{part:02x}' for part in parts)


def recorded(command: list[str], cols: int, rows: int, seconds: float) -> list[list]:
    """Run ``command`` on a terminal, its stderr apart, and return its cast."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack('HHHH', rows, cols, 0, 0))
    started, events = time.monotonic(), []
    with subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=subprocess.DEVNULL,
                          env=os.environ | {'TERM': 'xterm-256color'}) as process:
        os.close(theirs)
        rest = b''
        while time.monotonic() - started < seconds:
            try:
                rest += os.read(ours, 65536)
            except OSError:  # it has ended
                break
            whole, rest = _whole(rest)
            events.append([round(time.monotonic() - started, 3), 'o', whole])
        process.terminate()
    os.close(ours)
    return [{'version': 2, 'width': cols, 'height': rows}, *events]


def _whole(output: bytes) -> tuple[str, bytes]:
    """Return what can be printed, and the beginning of a character or of an escape sequence that follows it."""
    cut = len(output)
    if (escape := output.rfind(b'\x1b')) >= 0 and not COMMAND.match(output[escape:].decode('latin-1')):
        cut = escape
    try:
        output[:cut].decode()
    except UnicodeDecodeError as error:
        cut = error.start
    return output[:cut].decode(), output[cut:]


def screens(cast: list, rate: float) -> Iterator[tuple[list[list[Cell]], float]]:
    """Yield what was shown and for how long [s], looked at ``rate`` times a second from the first output on."""
    head, events = cast[0], [event for event in cast[1:] if event[1] == 'o']
    events = list(_bursts(events))
    screen, shown, since = Screen(head['width'], head['height']), None, 0.0
    number, ticks = 0, round((events[-1][0] - events[0][0]) * rate) + 1
    for tick in range(ticks + 1):
        now = events[0][0] + tick / rate
        while number < len(events) and events[number][0] <= now:
            screen.feed(events[number][2])
            number += 1
        cells = [row[:] for row in screen.cells]
        if cells != shown:
            if shown is not None:
                yield shown, tick / rate - since
            shown, since = cells, tick / rate
    yield shown or screen.cells, max(ticks / rate - since, LAST)


def _bursts(events: list[list]) -> Iterator[list]:
    """Join outputs that follow each other at once: between them a picture is half drawn."""
    joined: list | None = None
    for when, _, output in events:
        if joined and when - joined[0] < QUIET:
            joined = [when, 'o', joined[2] + output]
            continue
        if joined:
            yield joined
        joined = [when, 'o', output]
    if joined:
        yield joined


def drawn(cells: list[list[Cell]], rows: int) -> Image.Image:
    """Return the picture of the first ``rows`` of a screen."""
    font = ImageFont.truetype(FONT, FONT_SIZE)
    image = Image.new('RGB', (CELL[0] * len(cells[0]) + 2 * MARGIN, CELL[1] * rows + 2 * MARGIN), BACKGROUND)
    draw = ImageDraw.Draw(image)
    for y, row in enumerate(cells[:rows]):
        for x, cell in enumerate(row):
            left, top = x * CELL[0] + MARGIN, y * CELL[1] + MARGIN
            if cell.paper != BACKGROUND:
                draw.rectangle((left, top, left + CELL[0] - 1, top + CELL[1] - 1), cell.paper)
            if cell.text != ' ':
                draw.text((left, top), cell.text, cell.ink, font)
    return image


def of_cast(cast: list, rate: float) -> tuple[list[Image.Image], list[float]]:
    """Return the pictures of a cast, no higher than what it ever shows, and how long each stays [s]."""
    found = list(screens(cast, rate))
    used = max(y + 1 for cells, _ in found for y, row in enumerate(cells) if any(cell != Cell() for cell in row))
    return [drawn(cells, used) for cells, _ in found], [seconds for _, seconds in found]


def of_pictures(paths: Iterable[Path], width: int, period: float) -> tuple[list[Image.Image], list[float]]:
    """Return pictures of files, ``width`` pixels wide and as high as the first, each for ``period`` [s]."""
    images = [Image.open(path).convert('RGB') for path in paths]
    size = width, round(images[0].height * width / images[0].width)
    return [image.resize(size, Image.Resampling.LANCZOS) for image in images], [period] * len(images)


def save(path: Path, images: list[Image.Image], seconds: list[float], colours: int = 64) -> None:
    """Write the moving picture; one palette for all, or colours would flicker."""
    options = {'save_all': True, 'duration': [round(1000 * each) for each in seconds], 'loop': 0}
    if path.suffix == '.gif':
        together = Image.new('RGB', (images[0].width, images[0].height * min(len(images), 8)))
        for place, image in enumerate(images[::max(1, len(images) // 8)][:8]):
            together.paste(image, (0, place * image.height))
        palette = together.quantize(colours)
        images = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    elif path.suffix == '.webp':
        options |= {'lossless': True, 'method': 6, 'minimize_size': True}
    images[0].save(path, append_images=images[1:], optimize=True, **options)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('output', type=Path)
    parser.add_argument('--rate', type=float, default=5.0, help='pictures a second, default %(default)s')
    parser.add_argument('--seconds', type=float, default=20.0, help='of the program, default %(default)s')
    parser.add_argument('--cols', type=int, default=80)
    parser.add_argument('--rows', type=int, default=24)
    parser.add_argument('--width', type=int, default=900, help='of --pictures [pixels], default %(default)s')
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('--run', nargs=argparse.REMAINDER, help='the program and its arguments, last')
    source.add_argument('--cast', type=Path)
    source.add_argument('--pictures', type=Path, nargs='+')
    args = parser.parse_args()
    if args.pictures:
        images, seconds = of_pictures(args.pictures, args.width, 1 / args.rate)
    else:
        if args.cast:
            cast = [json.loads(line) for line in args.cast.read_text(encoding='utf-8').splitlines()]
        else:
            cast = recorded(args.run, args.cols, args.rows, args.seconds)
            args.output.with_suffix('.cast').write_text('\n'.join(map(json.dumps, cast)), encoding='utf-8')
        images, seconds = of_cast(cast, args.rate)
    save(args.output, images, seconds, 256 if args.pictures else 64)
    size = args.output.stat().st_size
    print(f'{args.output}: {len(images)} pictures, {images[0].width} x {images[0].height}, {sum(seconds):.1f} s, '
          f'{size / 1000:.0f} kB{" (too large for a page)" if size > LARGEST else ""}')


if __name__ == '__main__':
    main()
