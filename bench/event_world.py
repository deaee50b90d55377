"""Simulate contacts that are held, slide, turn or carry a load, for bench_events.py, with contact mechanics.

The skin of a held contact is a half-space, or an elastic layer on the rigid base of a finger. Only in a layer does a
load along the pad change the pressure on the taxels.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from elastic_layer import ElasticLayer
from stuck_contact import PitchJoint, stuck_response

from bench.recognition import mechanics
from tactile_node.pose.events import Motion
from tactile_node.pose.motion import SHIFT_PER_LOAD, MotionFollower, Sight
from tactile_node.pose.pipeline import ContactPipeline, Taxels, sight_of
from tactile_node.shape.methods import VisibilityGuard
from tactile_node.simulator.world import CLASSES
from training.ground_truth.layer import StressField, sample, stress_field
from training.ground_truth.mechanics import Solution

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
BEFORE_LIFT = 0.8     #: Time at rest before a lift [s].
AFTER_LIFT = 0.6      #: Time at rest after a lift [s].
BEGIN = 1e3           #: Stamp of the first frame [s].
QUIET = {'dx': 0.0, 'dy': 0.0, 'turn': 0.0, 'force': 1.0, 'load': 0.0}

CELL = 0.25           #: Cell of the surface of a layer [pitches].
MARGIN = 6.0          #: Margin of a layer around its contact [thicknesses].
THICKNESS = (0.001, 0.003)      #: Range of the thickness of a layer [m].
SHEAR_MODULUS = (1e5, 1e6)      #: Log-uniform range of the shear modulus of a layer [Pa].
COMPRESSIBLE = (0.01, 0.2)      #: Log-uniform range of 0.5 minus Poisson's ratio of a layer.
JOINTS = (np.inf, 100.0, 30.0)  #: Stiffnesses of the pitch joint of a finger [N m/rad].
LOADS = (0.1, 0.5)              #: Range of the load along the pad at the end of a lift [normal force].
RAMPS = (0.1, 2.0)              #: Log-uniform range of the time in which a lift raises the load [s].
PRESSED = 0.08                  #: Stress of a pressed taxel [fraction of the largest stress].
CHANGE = 0.2                    #: Largest change of the normal force during a lift [fraction of the force].
Path: TypeAlias = Callable[[float], dict[str, float]]  #: Maps a time [s] to the values that differ from QUIET.


class Sighting(NamedTuple):
    """The measurements from one frame, and the true place of the contact."""

    time: float
    place: dict[str, float]
    sight: Sight


class Frame(NamedTuple):
    """One frame with the reported motion and the true place of the contact."""

    time: float
    place: dict[str, float]
    motion: Motion


class FingerSkin(NamedTuple):
    """A skin of an elastic layer, and the pitch joint of its finger."""

    layer: ElasticLayer  # [m, Pa]
    joint: PitchJoint


class Lift(NamedTuple):
    """The path of a contact that carries loads and then slides."""

    path: Path
    seconds: float              # duration of the path [s]
    begins: tuple[float, ...]   # times at which the ramps of the load and the slide begin [s]


def random_skin(rng: np.random.Generator) -> FingerSkin:
    """Draw a skin, with one of JOINTS."""
    modulus, compressible = (float(np.exp(rng.uniform(*np.log(each)))) for each in (SHEAR_MODULUS, COMPRESSIBLE))
    layer = ElasticLayer(rng.uniform(*THICKNESS), modulus, 0.5 - compressible)
    return FingerSkin(layer, PitchJoint(float(rng.choice(JOINTS))))


class Scene:
    """A contact of one kind on a pad, seen in one ``way``: by its outline, its centre of pressure or on/off values.

    Without a ``skin``, the skin is a half-space, in which a load along the pad changes no pressure. A load acts in the
    direction `direction`, because the contact lies at a random angle to its load.
    """

    def __init__(self, rng: np.random.Generator, kind: str, way: str = 'outline', dead: float = DEAD,
                 skin: FingerSkin | None = None):
        draw = {'ball': mechanics.random_ball, 'cylinder': mechanics.random_cylinder, 'cone': mechanics.random_cone}
        indenter, tilt = draw.get(kind, mechanics.random_punch)(rng, KINDS.index(kind))
        towards = rng.uniform(0, 2 * np.pi) if indenter.kind == 'flat_punch' else 0.0
        self._solution = mechanics.solved(indenter, tilt, towards)
        area = float(rng.choice((16, 25, 40)))
        depth = rng.uniform(*mechanics.DEPTH)
        # distance from the centre to the farthest corner [pitches]
        self.radius = float(np.hypot(*self._solution.outline.T).max() * np.sqrt(area))
        self._rng, self._way, self._pressure = rng, way, rng.uniform(0.1, 0.6)
        self._x, self._y = (SIDE - 1) / 2 + rng.uniform(-0.5, 0.5, 2)
        self._angle, self._dead = rng.uniform(0, 2 * np.pi), rng.random((SIDE, SIDE)) < dead
        self._gain = rng.uniform(-GAIN_DRIFT, GAIN_DRIFT)
        self._zero = rng.uniform(-ZERO_DRIFT, ZERO_DRIFT, (SIDE, SIDE))
        self._hum, self._mains = rng.uniform(0, HUM), 50 + rng.uniform(-0.3, 0.3)
        self.direction = self._angle if skin else np.nan  #: direction of a load in the pad frame [rad]
        self._loaded: StressField | None = None
        if skin is None:
            self._field = stress_field(self._solution, area, depth)
        else:
            self._field, self._loaded = layer_fields(self._solution, area, rng.uniform(0, 2 * np.pi), skin,
                                                     self._pressure * FULL_SCALE)

    def values(self, time: float, dx: float, dy: float, turn: float, force: float, load: float) -> np.ndarray:
        """Return the taxel values of the contact.

        Parameters
        ----------
        time : float
            Time [s].
        dx, dy : float
            Displacement of the contact [pitches].
        turn : float
            Rotation of the contact [rad].
        force : float
            Factor of the normal force.
        load : float
            Load along the pad in units of the normal force at a factor of 1.
        """
        place = self._x + dx, self._y + dy, self._angle + turn, SIDE, SIDE
        stress = sample(self._field, *place)
        if self._loaded is not None:  # a taxel reads no tension
            stress = np.maximum(stress + load / force * sample(self._loaded, *place), 0)
        drift, noise = time / 600, NOISE * self._rng.standard_normal(stress.shape)
        values = self._pressure * force * (1 + self._gain * drift) * stress + self._zero * drift + noise
        values = np.minimum(values + self._hum * np.sin(2 * np.pi * self._mains * time), 1.0) * FULL_SCALE
        if self._way == 'on/off':
            values = (values > 0.3 * self._pressure * FULL_SCALE).astype(float)
        values[self._dead] = np.nan
        return values

    def shift_per_load(self, load: float) -> float:
        """Return the shift under ``load``, divided by ``load`` [m]. The shift is that of an outline without noise."""
        place = self._x, self._y, self._angle, SIDE, SIDE
        assert self._loaded is not None
        rest, loaded = sample(self._field, *place), sample(self._loaded, *place)
        before, after = (_middle(np.maximum(stress, 0)) for stress in (rest, rest + load * loaded))
        return float(np.hypot(*(after - before))) * PITCH / load

    def follow(self, recogniser: VisibilityGuard, path: Path, seconds: float,
               shift_per_load: float = SHIFT_PER_LOAD) -> list[Frame]:
        """Return the frames while the contact moves along ``path``."""
        return followed(self.see(recogniser, path, seconds), shift_per_load)

    def see(self, recogniser: VisibilityGuard, path: Path, seconds: float) -> list[Sighting]:
        """Return the measurements while the contact moves along ``path``."""
        pipeline = ContactPipeline(recogniser)
        taxels, frames = Taxels(PITCH, '1' if self._way == 'on/off' else 'Pa'), []
        for time in np.arange(round(seconds * RATE)) / RATE:
            place = QUIET | path(time)
            values = self.values(time, **place)
            found = pipeline.find(values, taxels)
            if self._way == 'centre of pressure':  # no shape is needed
                sight = Sight(BEGIN + time, found.pattern, found.visibility, found.moments, None, 0.0, PITCH, False)
            else:
                sight = sight_of(pipeline.recognise(found, BEGIN + time), BEGIN + time)
            frames.append(Sighting(time, place, sight))
        return frames


def followed(seen: list[Sighting], shift_per_load: float = SHIFT_PER_LOAD) -> list[Frame]:
    """Return the motions that follow from the measurements with the parameter ``shift_per_load`` [m]."""
    follower = MotionFollower(shift_per_load)
    return [Frame(each.time, each.place, follower.update(each.sight)) for each in seen]


def _middle(stress: np.ndarray) -> np.ndarray:
    """Return the mean of the centre of area and the centre of pressure of a contact [pitches]."""
    is_pressed = stress > PRESSED * stress.max()
    y, x = np.nonzero(is_pressed)
    places, weights = np.stack((x, y)), stress[is_pressed]
    middle: np.ndarray = (places.mean(1) + places @ weights / weights.sum()) / 2
    return middle


def layer_fields(solution: Solution, area: float, angle: float, skin: FingerSkin,
                 mean_pressure: float) -> tuple[StressField, StressField]:
    """Return the pressure at the base of a layer, and its change under a load along x that equals the normal force.

    Parameters
    ----------
    solution : Solution
        Pressure on the surface.
    area : float
        Area of the contact [taxels].
    angle : float
        Angle of the contact to the load [rad].
    skin : FingerSkin
        The skin of the finger.
    mean_pressure : float
        Mean pressure over the contact [Pa].
    """
    scale = float(np.sqrt(area)) / CELL
    surface = StressField(solution.pressure, solution.cell * scale,
                          (solution.origin[0] * scale, solution.origin[1] * scale))
    reach = float(np.hypot(*solution.outline.T).max()) * scale
    count = 2 * int(np.ceil(reach + MARGIN * skin.layer.thickness / PITCH / CELL)) + 1
    middle = (count - 1) / 2
    pressure = mean_pressure * sample(surface, middle, middle, angle, count, count)
    response = stuck_response(skin.layer, CELL * PITCH, pressure, skin.joint)
    none = np.zeros_like(pressure)
    base = skin.layer.base_pressure(CELL * PITCH, pressure, none, none)
    first = -middle * CELL
    rest, loaded = (StressField(each / mean_pressure, CELL, (first, first)) for each in (base, response.base))
    return rest, loaded


def lift(rng: np.random.Generator, scene: Scene, speed: float, far: float) -> Lift:
    """Return a path on which an object is lifted, put down, carried on its head and turned over, and then slides.

    The load goes to a share of the normal force, back to 0, to a share in the other direction, and at once to another
    share in the first direction. Each time, the normal force changes by up to CHANGE, and the contact rests for
    AFTER_LIFT. The slide covers ``far`` [pitches] at ``speed`` [mm/s] towards the load.
    """
    signs, rate = np.array((0.0, 1.0, 0.0, -1.0, 1.0)), speed * 1e-3 / PITCH
    loads = signs * rng.uniform(*LOADS, len(signs))
    forces = np.append(1.0, rng.uniform(1 - CHANGE, 1 + CHANGE, len(signs) - 1))
    begins = [BEFORE_LIFT]
    times, values = [0.0, BEFORE_LIFT], [0, 0]
    for number in range(1, len(signs)):
        reached = begins[-1] + float(np.exp(rng.uniform(*np.log(RAMPS))))
        begins.append(reached + AFTER_LIFT)
        times += [reached, begins[-1]]
        values += [number, number]

    def path(time: float) -> dict[str, float]:
        way = min(max(0.0, time - begins[-1]) * rate, far)
        return {'load': float(np.interp(time, times, loads[values])),
                'force': float(np.interp(time, times, forces[values])),
                'dx': way * np.cos(scene.direction), 'dy': way * np.sin(scene.direction)}
    return Lift(path, begins[-1] + far / rate + AFTER_LIFT / 2, tuple(begins))


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


def shaken(rng: np.random.Generator, weight: float = 0.0) -> Path:
    """Return a path on which the force varies, and the load varies by ``weight`` around ``weight``: a shake of 1 g.

    ``weight`` is in units of the normal force.
    """
    frequency = rng.uniform(*SHAKEN)
    along = rng.uniform(*SHAKEN) if weight else frequency
    return lambda time: {'force': 1 + SHAKE * np.sin(2 * np.pi * frequency * time),
                         'load': weight * (1 + np.sin(2 * np.pi * along * time))}


def moved(place: dict[str, float], radius: float = 0.0) -> float:
    """Return the distance that a contact has moved [pitches]."""
    return float(np.hypot(place['dx'], place['dy']) + abs(place['turn']) * radius)
