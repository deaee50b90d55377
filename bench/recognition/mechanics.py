"""Contacts computed by contact mechanics for the report.

The training never uses these indenters, parameters and seeds.

Lengths are in pitches and pressures in fractions of full scale. A separate indenter is solved for each frame, on a
finer grid than in the training.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tactile_node.shape.recogniser import OUTPUTS
from tactile_node.simulator.world import CLASSES, random_contact
from training.ground_truth.indenters import Indenter, ball, cone, cylinder, flat_punch
from training.ground_truth.layer import measured, sample, stress_field
from training.ground_truth.mechanics import Solution, solve
from training.ground_truth.seeds import Purpose, generator

SEEDS = 50_000_000  #: First seed of computed contacts, above the seeds of all other cases.
CELLS = 64          #: Number of grid cells per square root of the nominal contact area.
SIDES = (16, 24, 32, 48, 64)  #: Side lengths of the square pads [taxels].

#: Largest ratio of squared diameter to area in any class. A right triangle with legs of 2.5:1 has this ratio.
LONGEST = 5.8
ROOM = 2.0          #: Margin around the contact [pitches].

COMPRESSION = (0.01, 0.1)  #: Range of the log-uniform mean pressure, divided by the contact modulus.
ROUNDING = (0.05, 0.25)    #: Range of the edge rounding of a punch [fraction of the inscribed radius].
TILT = (0.0, 0.4)
DEPTH = (0.2, 1.2)         #: Range of the depth of the taxels [pitches].
PRESSURE = (0.05, 0.8)     #: Range of the mean pressure over the contact [fraction of full scale].
NOISE, DEAD = 0.01, 0.03


#: Function that returns an indenter and its tilt for the number of a frame.
Draw = Callable[[np.random.Generator, int], tuple[Indenter, float]]


class Case(NamedTuple):
    """Frames (K, side, side) [fraction of full scale] with NaN for dead taxels, and labels as indices into OUTPUTS."""

    frames: np.ndarray
    labels: tuple[int, ...]


def side_of(area: float) -> int:
    """Return the side of the square pad for contacts of any class with ``area`` taxels [taxels]."""
    return next(side for side in SIDES if side >= np.sqrt(LONGEST * area) + ROOM)


def pressed(draw: Draw, area: float, count: int, seed: int) -> Case:
    """Return frames of ``count`` indenters whose contacts have ``area`` taxels."""
    rng = generator(Purpose.EVALUATION, SEEDS + seed)
    made = []
    for number in range(count):
        indenter, tilt = draw(rng, number)
        made.append(_frame(rng, area, indenter, tilt))
    frames, labels = zip(*made)
    return Case(np.stack(frames), labels)


def random_punch(rng: np.random.Generator, number: int) -> tuple[Indenter, float]:
    """Draw a flat punch with rounded edges. Successive values of ``number`` cycle through the classes."""
    contact = random_contact(rng, CLASSES[number % len(CLASSES)], 1.0)
    upright = replace(contact, x=0.0, y=0.0, angle=0.0)
    return flat_punch(upright, _compression(rng), rng.uniform(*ROUNDING)), rng.uniform(*TILT)


def random_ball(rng: np.random.Generator, number: int) -> tuple[Indenter, float]:
    """Draw a ball, whose contact is a circle with a pressure that falls towards the rim."""
    return ball(_compression(rng)), 0.0


def random_cylinder(rng: np.random.Generator, number: int) -> tuple[Indenter, float]:
    """Draw a cylinder on its side, tilted along its axis, whose contact is a rectangle."""
    lying = cylinder(_compression(rng), rng.uniform(1.6, 2.8), rounding=rng.uniform(0.1, 0.5))
    return lying, rng.uniform(*TILT)


def random_cone(rng: np.random.Generator, number: int) -> tuple[Indenter, float]:
    """Draw a cone with a blunt tip, whose contact is a circle with a pressure peak in the middle."""
    return cone(_compression(rng), tip=rng.uniform(0.1, 0.5)), 0.0


#: Indenters in the rows of the report. Each row uses its own seeds.
ROWS: dict[str, Draw] = {'flat punches': random_punch, 'balls': random_ball, 'cylinders on their side': random_cylinder,
                         'cones': random_cone}


def _frame(rng: np.random.Generator, area: float, indenter: Indenter, tilt: float) -> tuple[np.ndarray, int]:
    towards = rng.uniform(0, 2 * np.pi) if indenter.kind == 'flat_punch' else 0.0
    solution = solved(indenter, tilt, towards)
    depth, pressure, angle = rng.uniform(*DEPTH), rng.uniform(*PRESSURE), rng.uniform(0, 2 * np.pi)
    side = side_of(area)
    around = turned(solution.outline, angle) * np.sqrt(area)
    # centre the bounding box on the pad, because a triangle reaches far from its centre of area
    middle = (around.min(0) + around.max(0)) / 2
    x, y = (side - 1) / 2 + rng.uniform(-0.5, 0.5, 2) - middle
    stress = sample(stress_field(solution, area, depth), x, y, angle, side, side)
    label = [shape.value for shape in OUTPUTS].index(solution.label)
    return measured(stress, pressure, rng, noise=NOISE, dead=DEAD), label


def solved(indenter: Indenter, tilt: float, towards: float) -> Solution:
    return solve(indenter, (float(tilt * np.cos(towards)), float(tilt * np.sin(towards))), cells=CELLS)


def turned(outline: np.ndarray, angle: float) -> np.ndarray:
    """Rotate the points of ``outline``, (n, 2), by ``angle`` from x towards y."""
    cos, sin = np.cos(angle), np.sin(angle)
    found: np.ndarray = outline @ np.array(((cos, sin), (-sin, cos)))
    return found


def _compression(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(*np.log(COMPRESSION))))
