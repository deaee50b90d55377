"""Write the background from which taught shapes are distinguished: patches of the five shapes and of foreign shapes.

python -m training.background --output config/teach_background.npz

The patches are drawn at random from the samples used to train the networks, from all pools except ``real``.
Their levels are stored in 16 steps, so that the file is small enough to be installed. `tactile teach` reads the file.
"""

import argparse
from pathlib import Path

import numpy as np

from tactile_node.shape.recogniser import KINDS
from training.drawn_by import claim
from training.ground_truth.seeds import Purpose, generator
from training.pools import Part, draw_part, read_parts
from training.samples import LEVEL_STEPS, UNKNOWN

#: Number of patches from each pool, for each kind of taxel.
COUNTS = {'bulk': 2000, 'large': 400, 'faulty': 900, 'mechanics': 1300, 'hidden': 500, 'blemish': 600,
          'foreign': 2600, 'noise': 200}
STEPS = 10       #: Number of steps from level 0 to level 1. Levels are clipped at 15 steps.
SEED = 950_000


def chosen(folder: Path, kind: str) -> dict[str, np.ndarray]:
    """Return the arrays for one kind of taxel.

    Parameters
    ----------
    folder : Path
        Folder with the drawn samples. Missing parts are drawn first.
    kind : str
        'graded' or 'on_off'.

    Returns
    -------
    dict of str to np.ndarray
        Levels (two cells per byte), unseen cells (eight cells per byte), scales [taxels] and labels. Each name begins
        with the kind.
    """
    rng, found = generator(Purpose.TRAINING, SEED + KINDS.index(kind)), []
    for pool, count in COUNTS.items():
        part = Part(kind, pool, 0)
        draw_part(folder, part)
        samples = read_parts(folder, [part])
        which = rng.choice(len(samples.labels), count, replace=False)
        scales = np.exp(samples.geometry[which, 2])  # describe_all stores the logarithm of the scale in column 2
        found.append((samples.levels[which], samples.unseen[which], scales, samples.labels[which]))
    levels, unseen, scales, labels = map(np.concatenate, zip(*found))
    order = rng.permutation(len(labels))
    steps = np.minimum(np.round(levels[order] / LEVEL_STEPS * STEPS), 15).astype(np.uint8).reshape(len(order), -1)
    return {f'{kind}_levels': steps[:, ::2] << 4 | steps[:, 1::2],
            f'{kind}_unseen': np.packbits(unseen[order].reshape(len(order), -1) > 127, axis=1),
            f'{kind}_scales': scales[order].astype(np.float32), f'{kind}_labels': labels[order].astype(np.uint8)}


def main() -> None:
    """Choose the patches and write them to a file."""
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
