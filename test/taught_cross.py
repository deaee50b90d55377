"""A cross drawn without the package's generator, and a model file that has been taught this cross.

The file was taught with 15 touches.
"""

from pathlib import Path

import numpy as np

from tactile_node.learning.background import Background, load_background
from tactile_node.learning.taught_file import examples_of, write_taught
from tactile_node.learning.teach import teach
from tactile_node.learning.touches import TouchFinder
from tactile_node.package_files import config_path
from tactile_node.shape.recogniser import ShapeRecogniser, read_arrays
from training.ground_truth.seeds import Purpose, generator

PAD, FINE = 16, 6
TAUGHT = 2  # number of the touches in the file
LOADS = 0, 0.3, 1, 1, 1, 1, 0.2, 0


def cross(rng, arm=4.3, half=1.5):
    """Return the pressures under two crossed bars at a random angle and position, with a mean of 1.

    The coverage of each taxel is sampled at FINE x FINE points.
    """
    step = (np.arange(PAD * FINE) + 0.5) / FINE - 0.5
    y, x = np.meshgrid(step, step, indexing='ij')
    x0, y0 = rng.uniform(-0.5, 0.5, 2) + (PAD - 1) / 2
    angle = rng.uniform(0, np.pi)
    u = abs((x - x0) * np.cos(angle) + (y - y0) * np.sin(angle))
    v = abs((y - y0) * np.cos(angle) - (x - x0) * np.sin(angle))
    inside = (np.minimum(u, v) <= half) & (np.maximum(u, v) <= arm)
    return inside.reshape(PAD, FINE, PAD, FINE).mean((1, 3))


def disc(rng, radius=4.0):
    x0, y0 = rng.uniform(-0.5, 0.5, 2) + (PAD - 1) / 2
    y, x = np.indices((PAD, PAD))
    return np.clip(radius + 0.5 - np.hypot(x - x0, y - y0), 0, 1)


def held(rng, pressed, count):
    """Yield the frames of ``count`` touches [Pa], with a lift after each touch."""
    frames = []
    for _ in range(count):
        covered = pressed(rng)
        frames += [50e3 * load * covered + 300 * rng.standard_normal(covered.shape) for load in LOADS]
    return np.array(frames)


def rng_of(number):
    return generator(Purpose.TEST, 770_000 + number)


def third_of_background():
    """Return every third background sample: a fast choice that is still enough to tell a cross from everything else."""
    whole = load_background('graded')
    return Background(whole.patches[::3], whole.labels[::3])


def examples(number, pressed=cross, count=15):
    return examples_of(TouchFinder('Pa').find(held(rng_of(number), pressed, count)).touches, rng_of(number + 1))


def write_taught_cross(path: Path) -> None:
    base, own = config_path('recogniser.npz'), examples(TAUGHT)
    taught = teach(ShapeRecogniser.from_file(base), third_of_background(), [own])
    assert taught.held_out.is_good
    with path.open('wb') as stream:
        write_taught(stream, read_arrays(base), ['cross'], {'graded': taught.head})
