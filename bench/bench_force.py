"""Measure how much the force on a pad differs from the true load, for several choices of the taxels that count.

The true load is known on four skins: the elastic foundation of the simulated gripper, the same skin under a cover that
spreads a part of the load, an elastic half-space, and elastic layers of 1 to 3 mm on a rigid base.
"""

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault('OMP_NUM_THREADS', '1')
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np
from event_world import FULL_SCALE, KINDS, PITCH, SIDE, layer_fields, random_skin
from planner_world import NOISE as FOUNDATION_NOISE
from planner_world import ROWS
from scipy import ndimage
from scipy.spatial.transform import Rotation

from bench.recognition import mechanics
from bench.recognition.halo_skins import REACH, halo_of_taxel
from examples.simulated_gripper.items import ITEMS
from examples.simulated_gripper.pressures import pressures
from tactile_node.contact.neighbours import grown
from tactile_node.grasp.gripper import Transform
from tactile_node.pose.pipeline import ContactPipeline, Taxels
from training.ground_truth.layer import sample, stress_field

SHAPES = ('circle', 'square', 'rectangle', 'right_triangle', 'isosceles_triangle', 'ball', 'bottle', 'bar')
FORCES = 1.0, 4.0          #: [N]
ZERO_ERRORS = 0.0, 0.005   #: common error of the zero, and standard deviation of each taxel's own [full scale]
NOISE = 0.01               #: standard deviation of the noise on elastic skins [full scale]
REST = 30                  #: frames before a contact
FRAMES = 10                #: frames during a contact
AREAS = 25.0, 40.0, 60.0   #: [taxels]
SPREAD = 0.3               #: share of the load that a cover spreads
TURN = 0.26                #: largest turn of an item [rad]
SHIFT = 0.004              #: largest shift of an item [m]
TILT = 0.03                #: largest tilt of an item [rad]
COUNTED = 'contact', 'and one ring', 'and two rings', 'whole pad'

Contact = Callable[[float], np.ndarray]  #: Maps a force [N] to taxel values without noise [Pa].


def on_foundation(rng: np.random.Generator, number: int) -> Contact:
    item = ITEMS[SHAPES[number % len(SHAPES)]]
    turn = (Rotation.from_rotvec((*rng.uniform(-TILT, TILT, 2), 0.0))
            * Rotation.from_euler('z', rng.uniform(-TURN, TURN))
            * Rotation.from_euler('x', np.pi / 2 if item.upright else 0.0))
    middle = (ROWS - 1) / 2 * PITCH + rng.uniform(-SHIFT, SHIFT, 2)
    pose = Transform(turn.as_matrix(), np.array((*middle, item.width / 2)))
    return lambda force: pressures(item, pose, force)


def under_cover(rng: np.random.Generator, number: int) -> Contact:
    bare, halo = on_foundation(rng, number), halo_of_taxel(rng.uniform(*REACH))

    def values(force: float) -> np.ndarray:
        pressure = bare(force)
        covered: np.ndarray = (1 - SPREAD) * pressure + SPREAD * ndimage.convolve(pressure, halo, mode='constant')
        return covered
    return values


def on_elastic(rng: np.random.Generator, number: int, is_layer: bool) -> Contact:
    draw = {'ball': mechanics.random_ball, 'cylinder': mechanics.random_cylinder, 'cone': mechanics.random_cone}
    kind = KINDS[number % len(KINDS)]
    indenter, tilt = draw.get(kind, mechanics.random_punch)(rng, number)
    solution = mechanics.solved(indenter, tilt, rng.uniform(0, 2 * np.pi) if indenter.kind == 'flat_punch' else 0.0)
    area, place = float(rng.choice(AREAS)), (SIDE - 1) / 2 + rng.uniform(-0.5, 0.5, 2)
    if is_layer:
        field, _ = layer_fields(solution, area, 0.0, random_skin(rng, np.inf), FULL_SCALE)
    else:
        field = stress_field(solution, area, rng.uniform(*mechanics.DEPTH))
    # a taxel reads no tension
    stress = np.maximum(sample(field, *place, rng.uniform(0, 2 * np.pi), SIDE, SIDE), 0)
    return lambda force: stress * force / (area * PITCH**2)


SKINS: dict[str, tuple[Callable[[np.random.Generator, int], Contact], float]] = {
    'foundation': (on_foundation, FOUNDATION_NOISE), 'covered': (under_cover, FOUNDATION_NOISE),
    'half-space': (lambda rng, number: on_elastic(rng, number, False), NOISE),
    'layer': (lambda rng, number: on_elastic(rng, number, True), NOISE)}


def forces(rng: np.random.Generator, values: np.ndarray, noise: float, zero_error: float) -> np.ndarray | None:
    """Return the force of each frame for each choice of COUNTED, or None if a frame shows no contact [N]."""
    zero, pipeline, found = zero_error * (1 + rng.standard_normal(values.shape)), ContactPipeline(fits=False), []
    for number in range(REST + FRAMES):
        read = (values if number >= REST else 0) + FULL_SCALE * (zero + noise * rng.standard_normal(values.shape))
        read = np.minimum(read, FULL_SCALE)
        pattern = pipeline.find(read, Taxels(PITCH, 'Pa')).pattern
        if number >= REST:
            if not pattern.contacts:
                return None
            counted = pattern.labels > 0
            masks = counted, grown(counted), grown(grown(counted)), np.ones_like(counted)
            found.append([np.maximum(read[mask], 0).sum() * PITCH**2 for mask in masks])
    return np.array(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--count', type=int, default=48, help='contacts of each row (default: %(default)s)')
    args = parser.parse_args()
    print('mean error and standard deviation over the contacts [%]; standard deviation from frame to frame [N]')
    print('| skin | force | zero error | contacts', *COUNTED, sep=' | ')
    for name, (draw, noise) in SKINS.items():
        for force in FORCES:
            for zero_error in ZERO_ERRORS:
                rng = np.random.default_rng(49)
                clean = [draw(rng, number)(force) for number in range(args.count)]
                read = [forces(rng, values, noise, zero_error) for values in clean if values.max() < FULL_SCALE]
                known = np.array([each for each in read if each is not None])
                errors, spread = 100 * (known.mean(1) / force - 1), np.median(known.std(1, ddof=1), axis=0)
                cells = (f'{error:+.1f} ± {sd:.1f}; {frame:.3f}'
                         for error, sd, frame in zip(errors.mean(0), errors.std(0, ddof=1), spread))
                print(f'| {name} | {force:g} N | {100 * zero_error:g} % | {len(known)}', *cells, sep=' | ')


if __name__ == '__main__':
    main()
