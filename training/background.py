"""What shapes that users teach are distinguished from: contacts of the five and foreign ones, as patches in one file.

python -m training.background --output config/teach_background.npz

A part of the samples that the networks were trained on, of every pool, with levels in 16 steps. `tactile teach` reads
it; it is small enough to be installed.
"""

import argparse
from pathlib import Path

import numpy as np

from tactile_node.shape.recogniser import KINDS
from training.drawn_by import claim
from training.ground_truth.seeds import Purpose, generator
from training.pools import Part, draw_part, read_parts
from training.samples import LEVEL_STEPS, UNKNOWN

#: patches of each pool and kind
COUNTS = {'bulk': 2000, 'large': 400, 'faulty': 900, 'mechanics': 1300, 'hidden': 500, 'blemish': 600,
          'foreign': 2600, 'noise': 200}
STEPS = 10       #: of a level 1; levels end at 15 of them
SEED = 950_000


def chosen(folder: Path, kind: str) -> dict[str, np.ndarray]:
    """The arrays of one kind: 4-bit levels two to a byte, unseen cells eight to a byte, log of the scale, labels."""
    rng, found = generator(Purpose.TRAINING, SEED + KINDS.index(kind)), []
    for pool, count in COUNTS.items():
        part = Part(kind, pool, 0)
        draw_part(folder, part)
        samples = read_parts(folder, [part])
        which = rng.choice(len(samples.labels), count, replace=False)
        scales = np.exp(samples.geometry[which, 2])  # as invariants.describe_all has them
        found.append((samples.levels[which], samples.unseen[which], scales, samples.labels[which]))
    levels, unseen, scales, labels = map(np.concatenate, zip(*found))
    order = rng.permutation(len(labels))
    steps = np.minimum(np.round(levels[order] / LEVEL_STEPS * STEPS), 15).astype(np.uint8).reshape(len(order), -1)
    return {f'{kind}_levels': steps[:, ::2] << 4 | steps[:, 1::2],
            f'{kind}_unseen': np.packbits(unseen[order].reshape(len(order), -1) > 127, axis=1),
            f'{kind}_scales': scales[order].astype(np.float32), f'{kind}_labels': labels[order].astype(np.uint8)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split(':')[0])
    parser.add_argument('--output', type=Path, default=Path('config/teach_background.npz'))
    parser.add_argument('--samples', type=Path, default=Path('build/samples'), help='as of training.train')
    args = parser.parse_args()
    claim(args.samples)
    arrays = {name: array for kind in KINDS for name, array in chosen(args.samples, kind).items()}
    np.savez_compressed(args.output, **arrays)
    foreign = sum(int((arrays[f'{kind}_labels'] == UNKNOWN).sum()) for kind in KINDS)
    print(f'{args.output}: {args.output.stat().st_size / 1e6:.2f} MB, {foreign} foreign patches')


if __name__ == '__main__':
    main()
