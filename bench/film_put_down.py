"""Film a put-down in the simulation of bench_put_down.py: python bench/film_put_down.py docs/put_down.gif.

An arm lowers an object onto a table, and stands still after the pads show the touch. The film shows the hand from the
side, the taxels of both pads, and the signals over time, at half speed.
"""

import argparse
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np
from bench_put_down import LATENCY, MAX_AGE, STOPPING
from event_world import PITCH, RATE
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.transforms import Affine2D
from PIL import Image
from put_down_world import Descent, Hand

from tactile_node.gripper.rules.put_down import BASELINE_TIME, PutDown, PutDownOutcome
from tactile_node.shape.methods import make_recogniser
from training.ground_truth.seeds import Purpose, generator

KIND = 'rectangle'
SEED = 93_000_000
DESCENT = Descent(weight=0.2, speed=0.002, met=3.0, pushes=True)
SECONDS = 5.0        #: Duration of the descent [s].
EACH = 2             #: Only one of this many readings is drawn.
SLOWED = 2           #: Duration of the film, divided by the duration of the descent.
REACH = 7            #: Number of taxels drawn on each side of the contact.
STILL_SHOWN = 3.0    #: Time for which the film stands still at its end [s].
SIZE = 8.4, 4.8      #: Width and height of a picture [inch].
DPI = 100
COLOURS = 48
SIDES = {'left': 'tab:blue', 'right': 'tab:orange'}
OBJECT = 20.0, 36.0  #: Width and height of the object [mm].
GRIPPED = 24.0       #: Height of the pads above the lower side of the object [mm].


class Shown(NamedTuple):
    """One reading of the descent."""

    time: float
    values: list[np.ndarray]         # taxels of the left and the right pad [Pa]
    places: tuple[np.ndarray, ...]   # centres of pressure [taxels]


class Filmed(NamedTuple):
    """A descent that has ended."""

    shown: list[Shown]
    down: list[float]   # direction of gravity on each pad [rad]
    result: float       # time at which the planner receives the result [s]
    signs: str          # signs of the touch

    @property
    def stopped(self) -> float:
        """Time at which the arm stands still [s]."""
        return self.result + STOPPING

    def moved(self, side: int) -> np.ndarray:
        """Return how far the pressure on a pad has moved against gravity since the baseline [mm]."""
        places = np.array([each.places[side] for each in self.shown])
        before = np.array([each.time < BASELINE_TIME for each in self.shown])
        up = -np.array((np.cos(self.down[side]), np.sin(self.down[side])))
        moved: np.ndarray = 1e3 * PITCH * (places - places[before].mean(axis=0)) @ up
        return moved


def filmed() -> Filmed:
    """Lower the object, and stop the arm after the touch."""
    hand = Hand(generator(Purpose.DEMO, SEED), KIND, make_recogniser())
    rules, shown, result = PutDown(0.0, np.inf, MAX_AGE), [], np.inf

    def path(time: float) -> dict[str, float]:
        return DESCENT.path(min(time, result + STOPPING))
    for reading in hand.see(path, SECONDS):
        places = tuple(np.array(each.place) / PITCH for each in reading.pads)
        shown.append(Shown(reading.acquired, hand.values, places))
        outcome = rules.look(reading.acquired, reading, is_resting=True) if result == np.inf else None
        if outcome is not None:
            assert outcome is PutDownOutcome.SOMETHING_TOUCHES, outcome
            result = reading.acquired + LATENCY
    return Filmed(shown, hand.down, result, rules.touch.signs.text)


def draw_side(axes: Axes, film: Filmed, time: float) -> None:
    """Draw the hand, the object and the table from the side [mm]."""
    hand = 1e3 * DESCENT.speed * (DESCENT.met - min(time, film.stopped))
    bottom, force = max(0.0, hand), DESCENT.pressed(min(time, film.stopped))
    width, height = OBJECT
    axes.set(xlim=(-32, 32), ylim=(-14, 50), aspect='equal', xticks=[], ylabel='height [mm]')
    axes.axhspan(-14, 0, color='0.75')
    axes.text(-30, -11, 'table', color='0.3')
    axes.add_patch(_box(-width / 2, bottom, width, height, 'tan'))
    axes.text(0, bottom + 6, '200 g', ha='center', va='center')
    for sign in (-1, 1):
        skin = sign * (width / 2 + 2.5)
        axes.add_patch(_box(skin - 2.5, hand + GRIPPED - 9, 5, 18, '0.3'))
        axes.add_patch(_box(skin + sign * 5 - 2.5, hand + GRIPPED - 9, 5, 40, '0.55'))  # finger
    if time < film.stopped:
        axes.annotate('', (-26, 10), (-26, 24), arrowprops={'arrowstyle': '->', 'lw': 2})
        axes.text(-30, 4, f'{1e3 * DESCENT.speed:g} mm/s')
    if force > 0:
        axes.annotate('', (0, 0), (0, -2 * force), arrowprops={'arrowstyle': '->', 'lw': 3, 'color': 'tab:red'})
        axes.text(3, -11, f'{force:.1f} N', color='tab:red')


def _box(x: float, y: float, width: float, height: float, colour: str) -> Rectangle:
    return Rectangle((x, y), width, height, color=colour)


def draw_pad(axes: Axes, film: Filmed, shown: Shown, side: int) -> None:
    """Draw the taxels of one pad around its contact, and its centre of pressure. The picture is turned upright."""
    x, y = np.round(film.shown[0].places[side])
    upright = Affine2D().rotate_around(x, y, np.pi / 2 - film.down[side]) + axes.transData
    axes.set_facecolor('0.6')  # dead taxels
    axes.imshow(shown.values[side], cmap='inferno', vmin=0, vmax=np.nanmax(film.shown[0].values[side]),
                interpolation='nearest', transform=upright)
    axes.plot(*shown.places[side], '+', color='cyan', markersize=14, markeredgewidth=2, transform=upright)
    name, colour = [*SIDES.items()][side]
    axes.set(xlim=(x - REACH, x + REACH), ylim=(y + REACH, y - REACH), xticks=[], yticks=[])
    axes.set_title(f'{name} pad', color=colour)


def draw(figure: Figure, film: Filmed, number: int) -> None:
    """Draw one picture of the film."""
    figure.clear()
    now = film.shown[number].time
    grid = figure.add_gridspec(3, 3, left=0.08, right=0.98, bottom=0.11, top=0.85, wspace=0.3, hspace=0.3,
                               width_ratios=(1.5, 1, 1), height_ratios=(2.2, 1, 0.8))
    draw_side(figure.add_subplot(grid[:, 0]), film, now)
    for side in range(2):
        draw_pad(figure.add_subplot(grid[0, 1 + side]), film, film.shown[number], side)
    times = np.array([each.time for each in film.shown[:number + 1]])
    above, below = (figure.add_subplot(grid[row, 1:]) for row in (1, 2))
    for side, (name, colour) in enumerate(SIDES.items()):
        above.plot(times, film.moved(side)[:number + 1], color=colour, lw=1.2, label=name)
    below.plot(times, DESCENT.pressed(np.minimum(times, film.stopped)), color='tab:red')
    above.set(ylabel='pressure\nmoved [mm]', ylim=(-0.3, 1.0), xticklabels=[])
    below.set(ylabel='force on the\ntable [N]', ylim=(-0.5, 7), xlabel='time [s]')
    for axes in (above, below):
        axes.yaxis.label.set_fontsize(9)
        axes.set_xlim(0, SECONDS)
        axes.axvspan(0, min(now, BASELINE_TIME), color='0.9')
    above.text(0.05, 0.7, 'baseline', color='0.4')
    for axes in (above, below):
        if now >= film.result:
            axes.axvline(film.result, color='tab:green', lw=2)
        if now >= film.stopped:
            axes.axvline(film.stopped, color='black', ls='--')
    if now >= film.result:
        above.text(film.result - 0.05, 0.7, 'SOMETHING_TOUCHES', color='tab:green', ha='right')
    if now >= film.stopped:
        below.text(film.stopped + 0.05, 0.2, 'arm stands still')
    figure.text(0.02, 0.94, _state(film, now), fontsize=13, weight='bold')
    figure.text(0.02, 0.02, 'half speed', color='0.4')


def _state(film: Filmed, now: float) -> str:
    if now >= film.stopped:
        return f'SOMETHING_TOUCHES ({film.signs}): the arm stands still.'
    if now >= film.result:
        return f'SOMETHING_TOUCHES ({film.signs}): the arm stops.'
    return 'The goal watches the object.' if now >= BASELINE_TIME else 'The goal takes a baseline.'


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('output', type=Path, metavar='GIF')
    args = parser.parse_args()
    film, figure, images = filmed(), Figure(figsize=SIZE, dpi=DPI), []
    canvas = FigureCanvasAgg(figure)
    print(f'result {film.result:.2f} s, {film.signs}, pressed {DESCENT.pressed(film.stopped):.1f} N')
    for number in range(0, len(film.shown), EACH):
        draw(figure, film, number)
        canvas.draw()
        images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]))
    palette = images[-1].quantize(COLOURS)
    images = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    durations = [round(1e3 * SLOWED * EACH / RATE)] * len(images)
    durations[-1] += round(1e3 * STILL_SHOWN)
    images[0].save(args.output, save_all=True, append_images=images[1:], duration=durations, loop=0)


if __name__ == '__main__':
    main()
