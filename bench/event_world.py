"""Simulate contacts that are held, slide or turn, for bench_events.py, with the methods of contact mechanics."""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from bench.recognition import mechanics
from tactile_node.pose.events import Motion
from tactile_node.pose.pipeline import ContactPipeline, Taxels
from tactile_node.shape.methods import VisibilityGuard
from tactile_node.simulator.world import CLASSES
from training.ground_truth.layer import sample, stress_field

KINDS = (*CLASSES, 'ball', 'cylinder', 'cone')
PITCH = 0.002         #: [m]
RATE = 50.0           #: [Hz]
SIDE = 24             #: Rows and columns of the pad.
FULL_SCALE = 100e3    #: [Pa]
NOISE = 0.01          #: Standard deviation of the noise [fraction of full scale].
DEAD = 0.03           #: Share of dead taxels.
GAIN_DRIFT = 0.05     #: Largest relative drift of the gain in ten minutes.
ZERO_DRIFT = 0.01     #: Largest drift of the zero in ten minutes [fraction of full scale].
HUM = 0.005           #: Largest amplitude of the mains hum [fraction of full scale].
SHAKE = 0.2           #: Amplitude of the varying force [fraction of the force].
SHAKEN = (5.0, 15.0)  #: Range of frequencies of the varying force [Hz].
STILL = 0.6           #: Time at rest after a movement [s].
BEFORE = 1.5          #: Time at rest before a movement [s].
QUIET = {'dx': 0.0, 'dy': 0.0, 'turn': 0.0, 'force': 1.0}
Path: TypeAlias = Callable[[float], dict[str, float]]  #: Maps a time [s] to the values that differ from QUIET.


class Frame(NamedTuple):
    """One frame with the reported motion and the true place of the contact."""

    time: float
    place: dict[str, float]
    motion: Motion
    naive: np.ndarray  # centre of pressure of the raw values [pitches]


class Scene:
    """A contact of one kind on a pad, seen in one ``way``: by its outline, its centre of pressure or on/off values."""

    def __init__(self, rng: np.random.Generator, kind: str, way: str = 'outline', dead: float = DEAD):
        draw = {'ball': mechanics.random_ball, 'cylinder': mechanics.random_cylinder, 'cone': mechanics.random_cone}
        indenter, tilt = draw.get(kind, mechanics.random_punch)(rng, KINDS.index(kind))
        towards = rng.uniform(0, 2 * np.pi) if indenter.kind == 'flat_punch' else 0.0
        self._solution = mechanics.solved(indenter, tilt, towards)
        area = float(rng.choice((16, 25, 40)))
        self._field = stress_field(self._solution, area, rng.uniform(*mechanics.DEPTH))
        # distance from the centre to the farthest corner [pitches]
        self.radius = float(np.hypot(*self._solution.outline.T).max() * np.sqrt(area))
        self._rng, self._way, self._pressure = rng, way, rng.uniform(0.1, 0.6)
        self._x, self._y = (SIDE - 1) / 2 + rng.uniform(-0.5, 0.5, 2)
        self._angle, self._dead = rng.uniform(0, 2 * np.pi), rng.random((SIDE, SIDE)) < dead
        self._gain = rng.uniform(-GAIN_DRIFT, GAIN_DRIFT)
        self._zero = rng.uniform(-ZERO_DRIFT, ZERO_DRIFT, (SIDE, SIDE))
        self._hum, self._mains = rng.uniform(0, HUM), 50 + rng.uniform(-0.3, 0.3)

    def values(self, time: float, dx: float, dy: float, turn: float, force: float) -> np.ndarray:
        """Return the taxel values of the contact.

        ``dx``, ``dy`` [pitches] and ``turn`` [rad] displace the contact. ``force`` multiplies the force of the contact.
        """
        stress = sample(self._field, self._x + dx, self._y + dy, self._angle + turn, SIDE, SIDE)
        drift, noise = time / 600, NOISE * self._rng.standard_normal(stress.shape)
        values = self._pressure * force * (1 + self._gain * drift) * stress + self._zero * drift + noise
        values = np.minimum(values + self._hum * np.sin(2 * np.pi * self._mains * time), 1.0) * FULL_SCALE
        if self._way == 'on/off':
            values = (values > 0.3 * self._pressure * FULL_SCALE).astype(float)
        values[self._dead] = np.nan
        return values

    def follow(self, recogniser: VisibilityGuard, path: Path, seconds: float, stamp: float = 1e3) -> list[Frame]:
        """Return the frames while the contact moves along ``path``."""
        pipeline = ContactPipeline(recogniser, fits=self._way != 'centre of pressure')
        taxels, frames = Taxels(PITCH, '1' if self._way == 'on/off' else 'Pa'), []
        for time in np.arange(round(seconds * RATE)) / RATE:
            place = QUIET | path(time)
            values = self.values(time, **place)
            motion = pipeline.follow(values, taxels, stamp + time).motion
            raw = np.nan_to_num(values)
            y, x = np.indices(raw.shape)
            frames.append(Frame(time, place, motion, np.array(((raw * x).sum(), (raw * y).sum())) / raw.sum()))
        return frames


def slide(rng: np.random.Generator, speed: float, far: float) -> tuple[Path, float]:
    """Return a path for a slide by ``far`` [pitches] at ``speed`` [mm/s], and the duration of the path [s]."""
    direction, rate = rng.uniform(0, 2 * np.pi), speed * 1e-3 / PITCH

    def path(time: float) -> dict[str, float]:
        way = min(max(0.0, time - BEFORE) * rate, far)
        return {'dx': way * np.cos(direction), 'dy': way * np.sin(direction)}
    return path, BEFORE + far / rate + STILL


def turn(rng: np.random.Generator, speed: float, far: float, radius: float) -> tuple[Path, float]:
    """Return a path for a turn that moves the farthest corner by ``far`` [pitches], and its duration [s]."""
    rate, sign = speed * 1e-3 / PITCH, rng.choice((-1, 1))

    def path(time: float) -> dict[str, float]:
        return {'turn': sign * min(max(0.0, time - BEFORE) * rate, far) / radius}
    return path, BEFORE + far / rate + STILL


def shaken(rng: np.random.Generator) -> Path:
    frequency = rng.uniform(*SHAKEN)
    return lambda time: {'force': 1 + SHAKE * np.sin(2 * np.pi * frequency * time)}


def moved(place: dict[str, float], radius: float = 0.0) -> float:
    """Return the distance that a contact has moved [pitches]."""
    return float(np.hypot(place['dx'], place['dy']) + abs(place['turn']) * radius)
