"""Fit the table in tactile_node/pose/model_error.py to computed contacts of the training indenters.

Run from the checkout: python bench/pose_calibration.py [--frames 3000] [--build build]

The first run takes some minutes to solve the training indenters, unless `make train` has already solved them. Replace
the table with the output of this script. A second run then changes the table only slightly. Punches and domes have
separate tables.
"""

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault('OMP_NUM_THREADS', '1')
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import numpy as np
from pose_mechanics import Pressed, error_of, outlined, pressed

from tactile_node.pose.fit import ShapeFit, fit_shape
from tactile_node.pose.model_error import (
    Loading,
    ModelError,
    area_and_radius,
    causes_of,
    errors_of,
    scales_of,
    share_of,
    spread_at,
)
from tactile_node.pose.outlines import OUTLINES, outline_of
from tactile_node.pose.profiles import DOMES, Indenter
from tactile_node.shape.recognition import Shape
from training.ground_truth.mechanics import Solution
from training.ground_truth.seeds import Purpose, generator
from training.mechanics import solution_pool

SEED = 950_000
TILT = 0.4            #: Largest tilt. Larger tilts cause errors that the fit's model does not explain.
AREAS = 22.0, 130.0   #: Range of the log-uniform contact areas [taxels].
OUTLIERS = 4.0        #: Residuals beyond this many robust standard deviations are ignored.
#: Parameters that have no bias, because the shape looks the same from both sides.
SYMMETRIC = {Shape.CIRCLE: (0, 1), Shape.SQUARE: (0, 1, 2), Shape.RECTANGLE: (0, 1, 2), Shape.RIGHT_TRIANGLE: (),
             Shape.ISOSCELES_TRIANGLE: (0, 2)}


def frames(folder: Path, shape: Shape, is_punch: bool, count: int) -> list[Pressed]:
    """Return frames of flat punches or domes of one class, at random poses, depths and pressures."""
    rng = generator(Purpose.TRAINING, SEED + list(OUTLINES).index(shape))
    solutions = [(solution, outlined(solution)) for solution in solution_pool(folder)
                 if _is_meant(solution, shape, is_punch)]
    found = []
    while len(found) < count:
        solution, outline = solutions[rng.integers(len(solutions))]
        frame = pressed(rng, solution, outline, float(np.exp(rng.uniform(*np.log(AREAS)))))
        if frame.mask.any():
            found.append(frame)
    return found


def _is_meant(solution: Solution, shape: Shape, is_punch: bool) -> bool:
    return ((solution.kind == 'flat_punch') == is_punch and solution.label == shape
            and np.hypot(*solution.tilt) < TILT)


def fitted(shape: Shape, drawn: list[Pressed]) -> list[tuple[Pressed, ShapeFit]]:
    """Return (frame, fit) pairs for all frames that can be fitted."""
    return [(frame, fit) for frame in drawn if (fit := fit_shape(frame.values, frame.mask, shape)) is not None]


def calibrated(shape: Shape, indenter: Indenter, drawn: list[tuple[Pressed, ShapeFit]]) -> ModelError:
    """Return the new row of the table, computed from the errors that remain with the current row.

    The function ignores fits that assume another kind of indenter.
    """
    errors, causes, spreads, deviations = [], [], [], []
    for frame, fit in drawn:
        if fit.indenter is not indenter:
            continue
        loading = Loading(indenter, fit.peak, fit.depth)
        outline, share = outline_of(shape, fit.handedness or 1), share_of(loading)
        error, (area, radius) = error_of(fit, frame.truth).vector, area_and_radius(outline.corners(fit.parameters))
        if share < 0.2 or not _is_same(fit, error):
            continue
        to_shape = np.linalg.inv(scales_of(outline, fit.handedness or 1, fit.parameters, radius))
        errors.append(to_shape @ error / share)
        causes.append(causes_of(outline, fit.parameters, radius, loading))
        spreads.append(spread_at(area))
        systematic = spreads[-1] * np.array(errors_of(shape, loading).deviation)
        deviations.append(np.diag(to_shape @ fit.covariance @ to_shape.T) / share ** 2 - systematic ** 2)
    print(f'    # {len(errors)} of {len(drawn)} fits')
    in_force = errors_of(shape, Loading(indenter, 1.0, 1.0))
    return _row(SYMMETRIC[shape], in_force, *map(np.array, (errors, causes, spreads, deviations)))


def _is_same(fit: ShapeFit, error: np.ndarray) -> bool:
    """Return False for a mirrored fit and for a fit with the wrong apex, whose lengths cannot be compared."""
    return abs(error[2]) < 0.3 if fit.symmetry in (1, 3) else True


def _row(symmetric: tuple[int, ...], in_force: ModelError, errors: np.ndarray, causes: np.ndarray, spreads: np.ndarray,
         noise: np.ndarray) -> ModelError:
    """Return a row of the table from K fits with p parameters.

    ``errors`` and ``noise`` have the shape (K, p), and ``causes`` has the shape (K, TERMS). ``noise`` is the stated
    variance without the model error.
    """
    terms, deviation = np.array(in_force[:-1], float), []
    for parameter, found in enumerate(errors.T):
        residual, used = found, np.ones(len(found), bool)
        if parameter not in symmetric:
            for _ in range(5):
                change, *_ = np.linalg.lstsq(causes[used] / spreads[used, None], found[used] / spreads[used])
                residual = found - causes @ change
                used = np.abs(residual) < OUTLIERS * _robust(residual)
            terms[:, parameter] += change
        by_size = residual / spreads
        own = np.median(np.maximum(noise[:, parameter], 0) / spreads ** 2)
        deviation.append(float(np.sqrt(max(_robust(by_size) ** 2 - own, 0.002 ** 2))))
    return ModelError(*(tuple(np.round(row, 3).tolist()) for row in (*terms, deviation)))


def _robust(values: np.ndarray) -> float:
    """Return a standard deviation from the central 95 % of the values, because the regions are 95 % regions."""
    low, high = np.quantile(values, (0.025, 0.975))
    return float(high - low) / 2 / 1.96


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--frames', type=int, default=3000, help='total number of frames of all shapes')
    parser.add_argument('--build', type=Path, default=ROOT / 'build', help='folder of the solved indenters')
    parser.add_argument('--pressure', choices=('punch', 'dome'), help='calibrate only these indenters')
    args = parser.parse_args()
    for name, shapes in (('punch', tuple(OUTLINES)), ('dome', tuple(DOMES))):
        for shape in map(Shape, shapes if args.pressure in (name, None) else ()):
            drawn = frames(args.build / 'mechanics', shape, name == 'punch', args.frames // len(OUTLINES))
            found = fitted(shape, drawn)
            for indenter in [Indenter.FLAT_PUNCH] if name == 'punch' else [one.indenter for one in DOMES[shape]]:
                print(f'    {indenter.value}, {shape}: {calibrated(shape, indenter, found)},', flush=True)


if __name__ == '__main__':
    main()
