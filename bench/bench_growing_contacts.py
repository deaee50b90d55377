"""Count false reports for contacts that grow from one edge, on an elastic layer.

Run from the checkout: nice python bench/bench_growing_contacts.py [--count 50]

A rigid face is pressed obliquely onto the layer, so the contact covers only a part of the face and grows with the
force. The gripper closes from 0.1 to 0.7 times the force. Then an object is lifted while the force rises to 1.4 times,
and put down while the force falls. The same measurements are followed by the detector, and by a detector that does not
know growth. The contact never slides.
"""

import argparse
import os
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from unittest.mock import patch

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ[f'{library}_NUM_THREADS'] = '1'  # numpy reads these variables when it is imported
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np
from elastic_layer import ElasticLayer
from event_world import CELL, FULL_SCALE, MARGIN, PITCH, RAMPS, FingerSkin, Scene, followed, random_skin
from stuck_contact import stuck_response

from tactile_node.pose import motion
from tactile_node.pose.events import EventKind
from tactile_node.shape.methods import make_recogniser
from tactile_node.simulator.world import CLASSES, random_contact
from training.ground_truth.layer import StressField
from training.ground_truth.seeds import Purpose, generator

SEED = 73_300_000
STEP = 2 * CELL * PITCH                                   #: Cell of the surface of the layer [m].
FORCES = np.array((0.1, 0.2, 0.35, 0.5, 0.7, 0.8, 1.0, 1.2, 1.4))  #: Factors of the force that are solved.
COVERED = 0.3, 0.95                                       #: Range of the share of the face in contact.
LOADS = 0.3, 0.5                                          #: Range of the load along the pad [normal force].
REST = 1.0                                                #: Time at rest after a ramp [s].
MOST_STEPS = 100
FALSE = EventKind.SLIDING, EventKind.TURNING


def pressed_face(layer: ElasticLayer, gap: np.ndarray, force: float) -> np.ndarray:
    """Return the pressure of a rigid face that is pressed without friction and does not rotate, (rows, cols) [Pa].

    Parameters
    ----------
    layer : ElasticLayer
        The layer, in metres and pascals.
    gap : np.ndarray
        Distance of the face from the undeformed surface with any offset, infinite outside the face, (rows, cols) [m].
    force : float
        Normal force [N].

    Raises
    ------
    RuntimeError
        Raised if the set of touching cells still changes after MOST_STEPS solutions.
    """
    unit = np.zeros(gap.shape)
    unit[0, 0] = 1.0
    rows, cols = np.nonzero(np.isfinite(gap))
    into = layer.surface(STEP, unit, 0 * unit, 0 * unit).z
    compliance, heights = into[np.subtract.outer(rows, rows), np.subtract.outer(cols, cols)], gap[rows, cols]
    touching = np.ones(len(rows), bool)
    for _ in range(MOST_STEPS):
        count = np.count_nonzero(touching)
        system = np.full((count + 1, count + 1), -1.0)
        system[:count, :count] = compliance[np.ix_(touching, touching)]
        system[count] = [STEP**2] * count + [0.0]
        *solved, depth = np.linalg.solve(system, [*-heights[touching], force])
        pressure = np.zeros(len(rows))
        pressure[touching] = solved
        before, touching = touching, (pressure > 0) | ~touching & (compliance @ pressure + heights < depth)
        if (touching == before).all():
            found = np.zeros(gap.shape)
            found[rows, cols] = pressure
            return found
    raise RuntimeError(f'pressed face: expected constant touching cells within {MOST_STEPS} solutions, got changes; '
                       f'check that the face is solid')


class GrowingScene(Scene):
    """A contact that grows from one edge with its force, and sticks to an elastic layer."""

    def __init__(self, rng: np.random.Generator, kind: str, skin: FingerSkin):
        super().__init__(rng, kind, 'centre of pressure')
        face = replace(random_contact(rng, kind, float(rng.choice((16, 25, 40)))), x=0.0, y=0.0)
        count = int(np.ceil(face.reach + MARGIN * skin.layer.thickness / PITCH) / (STEP / PITCH))
        steps = np.arange(-count, count + 1) * STEP / PITCH
        x, y = np.meshgrid(steps, steps)
        towards, mean, is_face = rng.uniform(0, 2 * np.pi), self._pressure * FULL_SCALE, face.depth(x, y) >= 0
        slope = (np.cos(towards) * x + np.sin(towards) * y) * PITCH
        covered = rng.uniform(*COVERED) * is_face.sum()
        force, low, high = mean * covered * STEP**2, 0.0, 2.0
        for _ in range(12):
            steepness = (low + high) / 2
            gap = np.where(is_face, steepness * slope, np.inf)
            is_flat = np.count_nonzero(pressed_face(skin.layer, gap, force)) > covered
            low, high = (steepness, high) if is_flat else (low, steepness)
        pressures, none = [pressed_face(skin.layer, gap, each * force) for each in FORCES], np.zeros(gap.shape)
        loaded = stuck_response(skin.layer, STEP, pressures[list(FORCES).index(1.0)], skin.joint).base
        self._origin, self.direction = (steps[0], steps[0]), self._angle
        self._bases = np.stack([skin.layer.base_pressure(STEP, each, none, none) / mean / of
                                for each, of in zip(pressures, FORCES)])
        self._loaded = StressField(loaded / mean, STEP / PITCH, self._origin)

    def values(self, time: float, dx: float, dy: float, turn: float, force: float, load: float) -> np.ndarray:
        upper = int(np.clip(np.searchsorted(FORCES, force), 1, len(FORCES) - 1))
        share = (force - FORCES[upper - 1]) / (FORCES[upper] - FORCES[upper - 1])
        base = (1 - share) * self._bases[upper - 1] + share * self._bases[upper]
        self._field = StressField(base, STEP / PITCH, self._origin)
        return super().values(time, dx, dy, turn, force, load)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--count', type=int, default=50, help='number of contacts')
    recogniser, grown = make_recogniser(), []
    false = {'detector': 0, 'detector that does not know growth': 0}
    count = parser.parse_args().count
    for number in range(count):
        rng = generator(Purpose.EVALUATION, SEED + number)
        scene = GrowingScene(rng, CLASSES[number % len(CLASSES)], random_skin(rng))
        ramp, load = float(np.exp(rng.uniform(*np.log(RAMPS)))), 1.4 * rng.uniform(*LOADS) * rng.choice((-1, 1))
        times = np.cumsum((0.0, REST, ramp, REST, ramp, REST, ramp, REST))

        def path(time: float, times: np.ndarray = times, load: float = load) -> dict[str, float]:
            return {'force': float(np.interp(time, times, (0.1, 0.1, 0.7, 0.7, 1.4, 1.4, 0.7, 0.7))),
                    'load': float(np.interp(time, times, (0, 0, 0, 0, load, load, 0, 0)))}
        seen = scene.see(recogniser, path, float(times[-1]))
        places = [np.array(each.sight.moments.centre_of_pressure) / PITCH for each in
                  scene.see(recogniser, lambda time: {'force': 0.8 if time < REST / 2 else 1.2}, REST)]
        half = len(places) // 2
        grown.append(float(np.hypot(*(np.mean(places[half:], 0) - np.mean(places[:half], 0)))))
        for name, growth in zip(false, (motion.GROWTH, 0.0)):
            with patch.object(motion, 'GROWTH', growth):
                reports = [frame.time for frame in followed(seen) for event in frame.motion.events
                           if event.kind in FALSE]
            false[name] += sum(any(begin <= time < end for time in reports)
                               for begin, end in pairwise((*times[1::2], np.inf)))
    median, most = np.quantile(grown, (0.5, 1.0))
    print(f'from 0.8 to 1.2 times the force, the centre of pressure moves by {median:.2f} pitches (median), '
          f'{most:.2f} (largest)')
    for name, reports_of in false.items():
        print(f'{name}: {reports_of} of {3 * count} ramps reported as a slide or a turn')


if __name__ == '__main__':
    main()
