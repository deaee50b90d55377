"""Measure how real arrays change a contact: gains, speckle, weak lines, cross-talk, noise, creep, rims, bars.

    python bench/measure_arrays.py --tekscan DIR --weiss DIR --vitac DIR [--output DIR]

Each DIR is a local copy of a public repository: TaISLab/CNN-based-Methods-for-Tactile-Object-Recognition,
peter-kiechle/tactile-sensors or jsheng45/ViTac-Tactile-Sensing. The script prints one line for each missing copy. The
script reads the labelled frames of the Tekscan array, and all recordings of the Weiss hand that contain a labelled
frame. The script also measures frames from the generator (training/real_arrays.py) in the same way. With --output, the
script writes a page and a picture of generated frames.
"""

import argparse
import sys
from collections import defaultdict
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use('Agg')
import matplotlib.pyplot as plt

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from bench.recognition.array_measures import ArrayGroup, measure, measure_over_time
from bench.recognition.page import Table, write_page
from bench.recognition.real_frames import PADS, TEKSCAN, VITAC, VITAC_PAD, WEISS, read_frames, read_hand, read_labels
from tactile_node.shape.recognition import Shape
from training.real_arrays import random_touch, read_by

PROFILES = 'pressure_profiles'  #: Folder in peter-kiechle/tactile-sensors.
STAMPED = f'{PROFILES}/calibration_weight_and_temperature/room temperature'  #: Recordings of the stamp.
HEATED = f'{PROFILES}/calibration_noise/temperature-noise.dsa'  #: Recording of the hand that warms up at rest.
STAMPED_PAD = 1  #: Number of the pad that the stamp pressed.
WEIGHTS = {'A': 200, 'B': 300, 'C': 400, 'D': 500, 'E': 600, 'F': 700, 'G': 800, 'H': 900}  #: [g]
STEP = 10  #: The script reads every 10th frame of ViTac, which is one frame per 0.1 s.
PLACES = {'tekscan': TEKSCAN, 'weiss': WEISS, 'vitac': VITAC}
DRAWN = 1500  #: Number of frames from the generator.
SEED = 20_261_123  #: Seed of the generator.
PICTURE = 'real_arrays.png'
ROWS = 3  #: Rows of frames in the picture.
COLS = 8  #: Columns of frames in the picture, one for each of the first pad sizes.

CONTACTS = ('*tekscan* has 50x28 taxels and stores 8-bit JPEG pictures; 500 frames of ten objects are used. *weiss* is '
            'a hand whose finger pads have 14x6 and 13x6 taxels with 12 bits; the hand cuts off readings below 100. '
            'The frame with the highest total pressure of each pad and grasp is used. *vitac* has 12x32 taxels with '
            'soft covers and scales each frame separately; every tenth frame is used. *drawn* are 1,500 frames of '
            'training/real_arrays.py. Each drawn frame has different gains, so the gains count as speckle.')
TIME = ('These quantities were measured only on the Weiss hand. The hand was at rest while it warmed up, and a square '
        'stamp of 1.1 cm² pressed it with 200 to 900 g. The generator draws only the noise.')
METHOD = ('The table describes the contacts of at least 9 taxels that `tactile classify` finds without options, '
          'together with the pieces that are torn off them. `bench/recognition/array_measures.py` describes the '
          'estimate of each quantity. The fixed profile of a curved finger or cover counts as gain. Weak taxels in a '
          'large contact count as hollow (ViTac).')
HOW = {
    'readings': 'all effects below, domes, tilt',
    'spread': 'all effects below',
    'gain': '0-0.3 of the logarithm',
    'speckle': '0-0.5 of the logarithm, smoothed by 0 or 0.4-1.2 taxels',
    'rows, columns': '0-0.2 of the logarithm',
    'weakest': 'factor 0.05-0.6 on 4 % of the lines, in half of the frames',
    'rings': 'blur of 0-0.9 taxels, 0-15 % from two neighbours',
    'cross-talk': '0-6 % of the highest reading of a line',
    'noise': '0-2 % of full scale; readings below 0-20 % of the level cut off',
    'hollow': '30 % of the circles, squares and rectangles that are large enough',
    'bars': '60 % of the rectangles, 2.2:1 to 30:1'}


def groups_of(array: str, data: Path) -> list[ArrayGroup]:
    """Return the measured frames of an array, in one group per pad or cover."""
    names = [one.frame for one in read_labels() if one.array == array]
    if array == 'tekscan':
        return [ArrayGroup(list(read_frames(array, data, names)), 255)]
    if array == 'weiss':
        hands = [read_hand(data / WEISS / file) for file in sorted({name.split('#')[0] for name in names})]
        return [ArrayGroup([hand[k][hand[k].sum((1, 2)).argmax()] for hand in hands], 4095) for k in range(len(PADS))]
    covers = sorted(cover for cover in (data / VITAC).iterdir() if 'Press' in cover.name)
    return [ArrayGroup([frame for file in sorted(cover.rglob('raw.csv'))
                        for frame in np.loadtxt(file, delimiter=',')[::STEP].reshape(-1, *VITAC_PAD)], 1.0)
            for cover in covers]


def drawn() -> list[ArrayGroup]:
    """Return frames from the generator, in one group per pad size."""
    rng, by_pad = np.random.default_rng(SEED), defaultdict(list)
    while sum(map(len, by_pad.values())) < DRAWN:
        if (touch := random_touch(rng, None)) is not None:
            frame = read_by(rng, touch, on_off=False)
            by_pad[frame.shape].append(frame)
    return [ArrayGroup(frames, max(frame.max() for frame in frames)) for frames in by_pad.values()]


def labelled_bars(array: str) -> str:
    labels = [one.label for one in read_labels() if one.array == array]
    return f'{labels.count(Shape.RECTANGLE.value)} of {len(labels)}' if labels else '-'


def draw(path: Path, groups: list[ArrayGroup]) -> None:
    """Draw frames from the generator, with one pad size per column."""
    figure, axes = plt.subplots(ROWS, COLS, figsize=(12, 4.5), layout='constrained')
    for k, axis in enumerate(axes.flat):
        axis.imshow(groups[k % len(groups)].frames[k // len(groups)], cmap='viridis', origin='lower')
        axis.axis('off')
    figure.savefig(path, dpi=80)


def tables_of(found: dict[str, dict[str, str]]) -> list[Table]:
    contacts = Table('Contacts', CONTACTS, ['', *found])
    for name in found['drawn']:
        contacts.add(name, *(of[name] for of in found.values()))
    contacts.add('labelled as bars', *map(labelled_bars, found))
    how = Table('How, and what is drawn', METHOD, ['quantity', 'the generator draws'])
    for name, text in HOW.items():
        how.add(name, text)
    return [contacts, how]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    for array, place in PLACES.items():
        parser.add_argument(f'--{array}', type=Path, help=f'folder with {place}')
    parser.add_argument('--output', type=Path, help='folder of the page')
    args = parser.parse_args()
    found, over_time = {}, None
    for array, place in PLACES.items():
        data = getattr(args, array)
        if data is None or not (data / place).exists():
            print(f'{array}: not measured; --{array} needs a folder with {place}')
            continue
        found[array] = measure(groups_of(array, data))
        if array == 'weiss' and (data / HEATED).exists():
            over_time = Table('Noise and creep', TIME, ['', 'weiss'])
            stamped = {weight: read_hand(data / STAMPED / f'{name}.dsa')[STAMPED_PAD]
                       for name, weight in WEIGHTS.items()}
            for row in measure_over_time(read_hand(data / HEATED), stamped).items():
                over_time.add(*row)
    groups = drawn()
    contacts, how = tables_of({**found, 'drawn': measure(groups)})
    tables = [contacts, *([over_time] if over_time else []), how]
    print('\n'.join(table.plain() for table in tables[:-1]))
    if args.output:
        draw(args.output / PICTURE, groups)
        write_page(args.output / 'real_arrays.md', 'What real arrays do to a contact', tables,
                   [(PICTURE, 'Frames that the generator draws')], script='bench/measure_arrays.py')
    return 0


if __name__ == '__main__':
    sys.exit(main())
