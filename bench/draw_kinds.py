"""Draw nine kinds of contacts that are hard to recognise on an unknown skin, and count the answers of this version.

    python bench/draw_kinds.py [--frames FOLDER] [--answers FILE] [--before FILE] [--picture FILE]

`--frames` saves the frames of each kind, so that an earlier version can classify the same frames. `--answers` writes
the counts. `--before` reads the counts of an earlier version, and the picture then also shows them. Each frame is
classified alone. No frame comes from a real array, and no frame is used for training.
"""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import ndimage

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import tactile_node as tn

COUNT = 50    #: Number of frames of each kind.
SEED = 461
FINE = 5      #: Number of sampling points along each side of a taxel.
SURE = 0.9    #: Confidence from which a planner acts on a name.

Inside = Callable[[np.ndarray, np.ndarray], np.ndarray]


def covered(pad: tuple[int, int], inside: Inside, blur: float) -> np.ndarray:
    """Return the share of each taxel that a figure covers, blurred by the cover of the skin.

    Parameters
    ----------
    pad : tuple of int
        Rows and columns of the pad.
    inside : callable
        Function of the coordinates x and y in taxel pitches, true inside the figure.
    blur : float
        Standard deviation of the blur [pitches].
    """
    y, x = ((np.mgrid[:pad[0] * FINE, :pad[1] * FINE] + 0.5) / FINE)
    fine = ndimage.gaussian_filter(inside(x, y).astype(float), blur * FINE)
    return fine.reshape(pad[0], FINE, pad[1], FINE).mean((1, 3))


def turned(x: np.ndarray, y: np.ndarray, x0: float, y0: float, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates along and across an axis through (x0, y0)."""
    u, v = x - x0, y - y0
    return u * np.cos(angle) + v * np.sin(angle), v * np.cos(angle) - u * np.sin(angle)


def block(x0: float, y0: float, length: float, width: float, angle: float = 0.0, corner: float = 0.0) -> Inside:
    """Return the figure of a rectangle whose corners have the radius ``corner``."""
    def inside(x, y):
        u, v = turned(x, y, x0, y0, angle)
        du, dv = np.abs(u) - length / 2 + corner, np.abs(v) - width / 2 + corner
        return np.hypot(du.clip(0), dv.clip(0)) + np.minimum(np.maximum(du, dv), 0) <= corner
    return inside


def gains(rng: np.random.Generator, pad: tuple[int, int], spread: float) -> np.ndarray:
    return np.exp(spread * rng.standard_normal(pad))


def block_with_halo(rng):
    pad, figure = (8, 16), block(rng.uniform(4, 12), rng.uniform(3.6, 4.4), 6, 6)
    load = covered(pad, figure, 0.3) + 0.6 * covered(pad, figure, 2)
    noise = 0.008 * rng.standard_normal(pad)
    return (0.05 + 0.5 * gains(rng, pad, 0.25) * load + noise).clip(0, 1)


def block_on_uneven_gains(rng):
    pad = 10, 18
    load = covered(pad, block(rng.uniform(6, 12), rng.uniform(4.5, 5.5), 6, 6), 0.3)
    lines = np.exp(0.5 * rng.standard_normal((1, pad[1])))
    return np.round(200 * load * gains(rng, pad, 0.4) * lines + rng.normal(0, 1, pad)).clip(0)


def few_taxels(rng):
    pad = 11, 11
    x0, y0 = rng.uniform(4, 7, 2)
    load = covered(pad, block(x0, y0, rng.uniform(2.4, 3.4), rng.uniform(2, 2.6), rng.uniform(0, 3), 1), 0.2)
    return np.round(80 * load * gains(rng, pad, 0.5)).clip(0)


def speckled_square(rng):
    pad, (x0, y0) = (28, 50), (rng.uniform(12, 38), rng.uniform(12, 16))
    load = covered(pad, block(x0, y0, 15, 15, rng.uniform(0.4, 1.2), 3), 0.7)
    y, x = np.indices(pad) + 0.5
    dome = (1.1 - 0.5 * ((x - x0) ** 2 + (y - y0) ** 2) / 90).clip(0.25)  # A soft block presses less at its corners.
    return np.round(150 * load * dome * gains(rng, pad, 0.4))


def arch(rng):
    pad, (x0, radius, squeeze) = (28, 50), (rng.uniform(15, 35), rng.uniform(5, 8), rng.uniform(2, 3))
    height, wall = rng.uniform(24, 29), rng.uniform(2.5, 4)
    load = covered(pad, lambda x, y: np.abs(np.hypot(x - x0, (y - height) / squeeze) - radius) < wall / 2, 0.7)
    return np.round(200 * load * np.linspace(0.3, 1.2, pad[0])[:, None] * gains(rng, pad, 0.25))


def weaker_part_beside_a_peak(rng):
    pad, (x0, y0) = (16, 16), rng.uniform(6.5, 9.5, 2)
    weak = covered(pad, block(x0, y0, rng.uniform(7, 9), rng.uniform(7, 9), rng.uniform(0, 1.5)), 0.5)
    peak = covered(pad, block(x0 + rng.uniform(-1.5, 1.5), y0 + rng.uniform(-1.5, 1.5), 3, 3, 0, 1), 0.7)
    return np.round(60 * weak * gains(rng, pad, 0.2) + rng.uniform(150, 300) * peak)


def ragged_spindle(rng):
    pad, (x0, y0, angle) = (53, 93), (rng.uniform(35, 58), rng.uniform(20, 33), rng.uniform(-0.5, 0.5))
    bend = rng.uniform(1, 3)

    def inside(x, y):
        u, v = turned(x, y, x0, y0, angle)
        return (np.abs(u) < 23) & (np.abs(v - bend * np.cos(u / 10)) < 6 * (1 - (u / 25) ** 2) + 0.7)
    rough = ndimage.gaussian_filter(rng.standard_normal(pad), 2) * 7
    return np.round(90 * covered(pad, inside, 0.6) * np.exp(0.35 * rough) * rng.uniform(0.6, 1, pad) - 8).clip(0)


def covers_the_pad(rng):
    pad = 6, 6
    load = covered(pad, block(*rng.uniform(2.7, 3.3, 2), rng.uniform(4.8, 6.4), rng.uniform(4.4, 5.4), 0, 1), 0.4)
    return np.round(12 + 60 * load * gains(rng, pad, 0.2) + rng.normal(0, 0.4, pad))


def fragment_of_an_uneven_object(rng):
    pad, (x0, y0, angle) = (32, 32), (rng.uniform(14, 18), rng.uniform(14, 18), rng.uniform(0, 3))

    def inside(x, y):
        u, v = turned(x, y, x0, y0, angle)
        radius = 8 + 2.5 * np.cos(3 * np.arctan2(v, u)) + 1.5 * np.cos(5 * np.arctan2(v, u) + 1)
        return np.hypot(u, v) < radius
    uneven = ndimage.gaussian_filter(rng.standard_normal(pad), 3)
    return np.round(120 * covered(pad, inside, 0.6) * np.exp(0.9 * uneven / uneven.std()))


#: Right answers for each kind. A planner does not act on the answer 'unknown'.
KINDS = {
    block_with_halo: ('square',), block_on_uneven_gains: ('square',), few_taxels: ('circle', 'unknown'),
    speckled_square: ('square',), arch: ('unknown',), weaker_part_beside_a_peak: ('unknown', 'square'),
    ragged_spindle: ('unknown',), covers_the_pad: ('unknown',), fragment_of_an_uneven_object: ('unknown',)}


class KindAnswers(NamedTuple):
    """Answers to the frames of one kind."""

    right: int
    sure_and_wrong: int
    example: str  #: answer to the first frame


def name_of(kind: Callable) -> str:
    return kind.__name__.replace('_', ' ')


def frames_of(kind: Callable) -> list[np.ndarray]:
    number = list(KINDS).index(kind)
    return [kind(np.random.default_rng([SEED, number, k])) for k in range(COUNT)]


def answers_to(frames: list[np.ndarray], right: tuple[str, ...]) -> KindAnswers:
    recogniser, found = tn.Recogniser(), []
    for frame in frames:
        shape = recogniser.recognise(tn.find_contact(frame.astype(float), unit=None))
        found.append((shape.shape.value, shape.confidence))
    correct = [name in right for name, _ in found]
    wrong = [not ok and name != 'unknown' and confidence >= SURE for ok, (name, confidence) in zip(correct, found)]
    return KindAnswers(sum(correct), sum(wrong), '{} {:.2f}'.format(*found[0]))


def draw(path: Path, now: dict[str, KindAnswers], before: dict[str, KindAnswers]) -> None:
    import matplotlib
    matplotlib.use('Agg')
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(3, 3, figsize=(9, 10), layout='constrained')
    for axis, (kind, right) in zip(axes.flat, KINDS.items()):
        frame = frames_of(kind)[0]
        axis.imshow(frame, cmap='viridis', origin='lower')
        axis.contour(tn.find_contact(frame.astype(float), unit=None).mask, levels=[0.5], colors='white', linewidths=1)
        rows = [('before', before.get(name_of(kind))), ('now', now[name_of(kind)])]
        text = [f'{when}: {one.example}\n{one.right} right, {one.sure_and_wrong} sure and wrong'
                for when, one in rows if one is not None]
        axis.set_title('\n'.join([f'{name_of(kind)} ({" or ".join(right)})', *text]), fontsize=9)
        axis.set_xticks([])
        axis.set_yticks([])
    figure.savefig(path, dpi=80)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    for option, text in {'frames': 'folder for the frames', 'answers': 'file for the counts of this version',
                         'before': 'counts of an earlier version', 'picture': 'file for the picture'}.items():
        parser.add_argument(f'--{option}', type=Path, help=text)
    args = parser.parse_args()
    now = {}
    for kind, right in KINDS.items():
        frames = frames_of(kind)
        if args.frames:
            args.frames.mkdir(parents=True, exist_ok=True)
            np.save(args.frames / f'{kind.__name__}.npy', frames)
        now[name_of(kind)] = one = answers_to(frames, right)
        print(f'{name_of(kind):30s} right {one.right} of {COUNT}, sure and wrong {one.sure_and_wrong}; {one.example}')
    if args.answers:
        args.answers.write_text(json.dumps(now, indent=1) + '\n', encoding='utf-8')
    before = json.loads(args.before.read_text(encoding='utf-8')) if args.before else {}
    if args.picture:
        draw(args.picture, now, {name: KindAnswers(*one) for name, one in before.items()})
    return 0


if __name__ == '__main__':
    sys.exit(main())
