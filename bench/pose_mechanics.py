"""Fit contacts computed by contact mechanics, whose pressures differ from the model of the fit.

The true outline is the outline, of the same shape, that best covers the solver's contact set.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from pose_world import Error, error_from
from scipy.stats import chi2

from bench.recognition import mechanics
from bench.recognition.figures import rate_of
from tactile_node import find_contact
from tactile_node.pose.evidence import gather
from tactile_node.pose.fit import ShapeFit, fit_shape
from tactile_node.pose.outline_fit import OutlineFit
from tactile_node.pose.outlines import OUTLINES
from tactile_node.shape.recognition import Shape
from training.ground_truth.layer import measured, sample, stress_field
from training.ground_truth.mechanics import Solution
from training.ground_truth.seeds import Purpose, generator

AREAS = (25, 50, 100)
FLAT = 'flat punches'  #: Name of these indenters in mechanics.ROWS.
CUT = 'flat punches over the edge'  #: Name of the row of flat punches that the pad's edge cuts.
MOST_CUT = 1 / 3  #: Largest share of a contact that lies beyond the pad's edge.

#: Increase this number by a million after each change that a report prompts, so that the next report uses new seeds.
SEED = 61_000_000


class Outlined(NamedTuple):
    """The contact set of a solution as a shape, relative to the indenter's origin and scaled to an area of 1."""

    parameters: np.ndarray
    handedness: int


class Pressed(NamedTuple):
    """A frame with its contact and the true parameters of the contact's outline [pitches, rad]."""

    shape: Shape
    values: np.ndarray
    mask: np.ndarray
    truth: np.ndarray


class Row(NamedTuple):
    """Results of the fits for one kind of indenter and one contact size."""

    name: str
    area: float
    errors: list[Error]
    signed: np.ndarray   #: mean relative error of the lengths of each fit [%]
    inside: np.ndarray   #: True for each fit whose 95 % region contains the truth
    residuals: np.ndarray

    @property
    def bias(self) -> float:
        return float(np.median(self.signed))

    @property
    def spread(self) -> float:
        low, high = np.quantile(self.signed, (0.16, 0.84))
        return float(high - low) / 2


def outlined(solution: Solution) -> Outlined:
    """Return the shape that covers the contact set best. An on/off fit is accurate, because the cells are small."""
    outline = OutlineFit(Shape(solution.label))
    outline.search(gather(solution.contact, solution.contact, size=1))
    fit = ShapeFit.of(outline, solution.cell)
    parameters = fit.parameters.copy()
    parameters[:2] += solution.origin
    return Outlined(parameters, fit.handedness)


def pressed(rng: np.random.Generator, solution: Solution, found: Outlined, area: float) -> Pressed:
    """Return a frame of ``solution`` with a contact of ``area`` taxels at a random pose, depth and pressure."""
    shape, depth, pressure = Shape(solution.label), rng.uniform(*mechanics.DEPTH), rng.uniform(*mechanics.PRESSURE)
    side, angle = mechanics.side_of(area) + 4, rng.uniform(0, 2 * np.pi)
    x, y = (side - 1) / 2 + rng.uniform(-0.5, 0.5, 2)
    stress = sample(stress_field(solution, area, depth), x, y, angle, side, side)
    values = measured(stress, pressure, rng, noise=mechanics.NOISE, dead=mechanics.DEAD)
    truth, first = found.parameters.copy(), 3 if OUTLINES[shape].symmetry else 2
    truth[:2] = (x, y) + mechanics.turned(found.parameters[None, :2], angle)[0] * np.sqrt(area)
    truth[2:first] += angle
    truth[first:] *= np.sqrt(area)
    return Pressed(shape, values, find_contact(values, unit=None).mask, truth)


def draw(rng: np.random.Generator, name: str, area: float, count: int) -> list[Pressed]:
    """Return ``count`` frames of one kind of indenter, each computed from a separate solution."""
    frames = []
    for number in range(count):
        indenter, tilt = mechanics.ROWS[FLAT if name == CUT else name](rng, number)
        towards = rng.uniform(0, 2 * np.pi) if indenter.kind == 'flat_punch' else 0.0
        solution = mechanics.solved(indenter, tilt, towards)
        frame = pressed(rng, solution, outlined(solution), area)
        frames.append(_cut(rng, frame) if name == CUT else frame)
    return frames


def _cut(rng: np.random.Generator, frame: Pressed) -> Pressed:
    """Remove pad columns that contain up to MOST_CUT of the contact, and return the frame."""
    lost = np.cumsum(frame.mask.sum(0)) / frame.mask.sum()
    first = int(np.searchsorted(lost, MOST_CUT * rng.random(), side='right')) + 1
    values, truth = frame.values[:, first:], frame.truth - np.eye(len(frame.truth))[0] * first
    return frame._replace(values=values, mask=find_contact(values, unit=None).mask, truth=truth)


def error_of(fit: ShapeFit, truth: np.ndarray) -> Error:
    """Return the error of a fit, given the symmetry that the fit declares."""
    return error_from(fit.parameters, fit.symmetry, truth, len(fit.dimensions))


def measure(name: str, area: float, frames: list[Pressed]) -> Row:
    """Fit all frames that contain a contact."""
    frames = [frame for frame in frames if frame.mask.any()]
    fits = [fit_shape(frame.values, frame.mask, frame.shape) for frame in frames]
    errors = [error_of(fit, frame.truth) for fit, frame in zip(fits, frames)]
    signed = [100 * float(np.mean(error.vector[-len(fit.dimensions):] / frame.truth[-len(fit.dimensions):]))
              for fit, frame, error in zip(fits, frames, errors)]
    squared = [error.vector @ np.linalg.solve(fit.covariance, error.vector) for fit, error in zip(fits, errors)]
    inside = [found < chi2.ppf(0.95, len(error.vector)) for found, error in zip(squared, errors)]
    return Row(name, area, errors, np.array(signed), np.array(inside), np.array([fit.residual for fit in fits]))


def report(table: Callable[[str, list[str], list[list[str]]], None], count: int,
           purpose: Purpose = Purpose.EVALUATION) -> None:
    """Fit ``count`` frames for each kind of indenter and contact size, and write the results as a table."""
    rows = []
    for number, (name, area) in enumerate((name, area) for name in (*mechanics.ROWS, CUT) for area in AREAS):
        found = measure(name, area, draw(generator(purpose, SEED + number), name, area, count))
        rows.append(_cells(found))
        print(' | '.join(rows[-1]), flush=True)
    table('Contact mechanics',
          ['object', 'N', 'fits', 'bias', 'spread', 'centre', 'angle', 'in the 95 % region', 'residual'], rows)


def _cells(row: Row) -> list[str]:
    angles = [error.angle for error in row.errors if error.angle == error.angle]
    return [row.name, f'{row.area:g}', str(len(row.errors)), f'{row.bias:+.2f}', f'{row.spread:.2f}',
            f'{np.median([error.centre for error in row.errors]):.3f}', f'{np.median(angles):.2f}' if angles else '-',
            str(rate_of(row.inside)), f'{np.median(row.residuals):.3f}']
