"""What a choice in the training is judged by: figures on validation seeds and families, never on those reported.

python -m training.validate [config/recogniser.npz]
"""

import argparse
from pathlib import Path

import numpy as np

from tactile_node.shape.patch import joined
from tactile_node.shape.recogniser import KINDS, ShapeRecogniser
from tactile_node.simulator.world import Contact
from training.batch import draw_forms
from training.calibration import mechanics_samples
from training.field import NOMINAL_ON_OFF, NOMINAL_PRESSURE, Conditions, field_frame
from training.forms import ALL, Forms, stored_forms
from training.ground_truth.seeds import Purpose, generator
from training.held_out import HELD_OUT
from training.noise import draw_noise
from training.patches import samples_of
from training.samples import LABELS, LEVEL_STEPS, UNKNOWN, Samples, random_conditions, samples_from
from training.segmentation import ON_OFF, as_shipped, pattern_at

SEED = 31_000
AREAS = (12, 25, 50, 100)
FIGURES = {'foreign': 260, 'blemish': 200, 'held_out': 120}


def probabilities(recogniser: ShapeRecogniser, kind: str, samples: Samples) -> np.ndarray:
    """Of OUTPUTS, (K, 6)."""
    images = np.stack((samples.levels / LEVEL_STEPS, samples.unseen / 255), -1).astype(np.float32)
    logits = recogniser._networks[kind](images, samples.geometry)
    return recogniser._calibrations[kind].probabilities(logits.astype(float), samples.geometry[:, 0])


def clean(rng, kind: str, area: float, count: int, faulty: float = 0.0) -> Samples:
    found = []
    for k in range(count):
        label = LABELS[k % UNKNOWN]
        conditions = NOMINAL_ON_OFF if kind == 'on_off' else NOMINAL_PRESSURE
        if faulty:
            conditions = random_conditions(rng, kind == 'on_off', 1.0)
        frame = field_frame(rng, label, area, conditions)
        if faulty:
            pattern = pattern_at(frame, ON_OFF if kind == 'on_off' else conditions.threshold * conditions.pressure)
        else:
            pattern = as_shipped(frame, kind == 'on_off')
        if pattern.mask.sum() > 4:
            found.append((pattern, pattern.mask if conditions.second else joined(pattern), k % UNKNOWN))
    return samples_from(found)


def torn(rng, kind: str, count: int) -> Samples:
    """Hollow contacts with pairs of silent rows or columns, as the recording of the ring is described."""
    found = []
    for k in range(count):
        conditions = Conditions(on_off=kind == 'on_off', wall=rng.uniform(0.15, 0.5), silent_lines=2,
                                silent_places=int(rng.integers(1, 4)), stuck=0.01)
        frame = field_frame(rng, LABELS[k % UNKNOWN], rng.uniform(60, 300), conditions)
        pattern = as_shipped(frame, kind == 'on_off')
        found.append((pattern, joined(pattern), k % UNKNOWN))
    return samples_from(found)


def aligned_squares(kind: str) -> Samples:
    """Squares of 4 to 64 taxels a side along the lattice, on a pad with room and on one that they fill."""
    frames = []
    for side in range(4, 65):
        square = Contact('square', (float(side), float(side)), x=35.5 + side % 2 / 2, y=35.5 + side % 2 / 2)
        frames.append(square.pattern(73, 73).astype(float))
    found = samples_of(np.random.default_rng(0), np.array(frames), np.full((1, 1, 1), 0.5),
                       np.zeros((len(frames), 73, 73), bool), np.full(len(frames), LABELS.index('square')), False)
    return found


def figures(rng, kind: str, forms: Forms, areas: tuple[float, float], count: int, pad: int) -> Samples:
    drawn = []
    for _ in range(count // 100):
        which = rng.integers(len(forms.labels), size=100)
        area = np.exp(rng.uniform(*np.log(areas), 100))
        drawn.append(draw_forms(rng, forms.chosen(which), area, kind == 'on_off', faulty=0.0, pad=pad))
    return Samples(*map(np.concatenate, zip(*drawn)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split(':')[0])
    parser.add_argument('weights', nargs='?', default='config/recogniser.npz')
    parser.add_argument('--build', type=Path, default=Path('build'))
    parser.add_argument('--count', type=int, default=2000)
    parser.add_argument('--kinds', nargs='*', default=KINDS)
    args = parser.parse_args()
    recogniser = ShapeRecogniser.from_file(args.weights)
    pools = {name: stored_forms(args.build / 'validation', name, families, FIGURES[name], Purpose.VALIDATION,
                                SEED + number)
             for number, (name, families) in enumerate({**ALL, 'held_out': HELD_OUT}.items())}
    for kind in args.kinds:
        for name, samples in _sets(kind, pools, args):
            found = probabilities(recogniser, kind, samples)
            answer = found.argmax(1)
            right, lost = np.mean(answer == samples.labels), np.mean(answer == UNKNOWN)
            print(f'{kind:7s} {name:28s} {len(answer):6d}  right {100 * right:6.2f} %  unknown {100 * lost:6.2f} %',
                  flush=True)


def _sets(kind: str, pools: dict[str, Forms], args):
    rng = generator(Purpose.VALIDATION, SEED)
    on_off, count = kind == 'on_off', args.count
    for area in AREAS:
        yield f'clean {area}', clean(rng, kind, area, count)
    for area in AREAS:
        yield f'field {area}', clean(rng, kind, area, count, faulty=1.0)
    for low, high in ((10, 14), (21, 29), (42, 58), (84, 116)):
        yield f'mechanics {low}-{high}', mechanics_samples(rng, on_off, count, args.build / 'mechanics', (low, high))
    yield 'hollow, torn', torn(rng, kind, count)
    if on_off:
        yield 'aligned squares', aligned_squares(kind)
    for name, forms in pools.items():
        foreign, known = (forms.chosen(chosen) for chosen in (forms.labels == UNKNOWN, (forms.labels >= 0)
                                                              & (forms.labels < UNKNOWN)))
        if name != 'blemish':
            for low, high, pad in ((20, 40, 28), (40, 60, 34), (60, 150, 42), (150, 400, 60)):
                yield f'{name}, foreign {low}-{high}', figures(rng, kind, foreign, (low, high), count, pad)
            clear = foreign.chosen(foreign.overlaps.max(1) < 0.8)
            yield f'{name}, below 0.8, 40-100', figures(rng, kind, clear, (40, 100), count, 40)
        else:
            yield f'{name}, foreign 60-400', figures(rng, kind, foreign, (60, 400), count, 60)
            for low, high, pad in ((40, 100, 34), (100, 400, 56)):
                yield f'{name}, known {low}-{high}', figures(rng, kind, known, (low, high), count, pad)
    yield 'noise', draw_noise(rng, count, on_off)


if __name__ == '__main__':
    main()
