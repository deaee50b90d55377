"""The bench in physics: a hand, a gripper and an item on a table, stepped by hand or by a thread in real time."""

import threading
import time
from enum import Enum
from math import pi, radians
from typing import NamedTuple

import numpy as np

from bench.planner_world import ROWS
from examples.simulated_gripper.drive import Command, Drive
from examples.simulated_gripper.items import Item
from examples.simulated_gripper.model import MAX_GAP, STEP, model_of
from examples.simulated_gripper.pressures import by_depth, pressures
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.grasp.gripper import Transform

try:
    import mujoco
except ImportError:  # no dependency of the package
    mujoco = None

SIDES = ('left', 'right')
MAX_SHIFT, MAX_TURN = 0.008, radians(15)  #: of an item from where the hand is sent [m, rad]
SPEEDS = {'x': 0.05, 'y': 0.05, 'lift': 0.05, 'yaw': 0.5}  #: of the hand [m/s, rad/s]
AXES = tuple(SPEEDS)
LIFTED = 0.01             #: above where the hand was when the item was last on the table: it has been taken along [m]
GRAVITY = 9.81
SHAKE_FREQUENCY = 6.0     #: Hz
LOOP_PERIOD = 0.004       #: of the thread [s]
PULL_STIFFNESS = 2000.0   #: N/m
MOST_BEHIND = 0.1         #: of the thread: what is more is left out [s]


class Outcome(Enum):
    """What has become of the item."""

    FREE = 'free'          #: the pads do not both touch it, and it has not been dropped
    GRIPPED = 'gripped'    #: both pads touch it, and so does the table or the stand
    HELD = 'held'          #: both pads touch it, and nothing else does
    DROPPED = 'dropped'    #: it was held, and now it is lost, until it is placed again
    BROKEN = 'broken'      #: a pad has pressed more than its strength, until it is placed again


class Place(NamedTuple):
    """Place of an item, from where the hand is sent [m, rad]."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


AIM = Place()


def random_place(seed: int) -> Place:
    """Draw a place up to MAX_SHIFT away, in any direction, turned by up to MAX_TURN."""
    rng = np.random.default_rng(seed)
    distance, way = MAX_SHIFT * np.sqrt(rng.random()), rng.uniform(0, 2 * pi)
    return Place(float(distance * np.cos(way)), float(distance * np.sin(way)), float(rng.uniform(-MAX_TURN, MAX_TURN)))


class World:
    """One item on the bench. Every method is for any thread; raises ConfigurationError without MuJoCo.

    In the left pad's frame the hand's x is x, its lift is -y, its y is z: a yaw turns it about -y. ``has_sensors``:
    pressures are those of MuJoCo's tactile sensor, which feels no triangles.
    """

    def __init__(self, item: Item, place: Place = AIM, has_sensors: bool = False):
        if mujoco is None:
            raise ConfigurationError('simulated gripper', expected='MuJoCo', got='no module of that name',
                                     remedy='Install it: pip install -r requirements/bench_physics.txt')
        self.item, self._has_sensors = item, has_sensors
        self.model = mujoco.MjModel.from_xml_string(model_of(item, has_sensors))
        self.data = mujoco.MjData(self.model)
        self.lock = threading.RLock()  #: held while the physics steps
        self._geom = self.model.geom('item').id
        self._skins = {self.model.geom(f'{side}_skin').id: side for side in SIDES}
        self._running: threading.Thread | None = None
        self._stopping = threading.Event()
        self.left_out = 0.0            #: of real time, by a thread that the machine was too slow for [s]
        self.place(place)

    def place(self, place: Place = AIM) -> None:
        """Put the item, whole again, on its stand at ``place``; the hand goes back, open and down, at once."""
        with self.lock:
            now = self.now  # which goes on
            mujoco.mj_resetData(self.model, self.data)
            self.data.time = now
            cos, sin = np.cos(place.yaw), np.sin(place.yaw)
            rest, pose = self.item.rest, self.data.joint('item').qpos
            pose[:3] = rest.translation + (place.x, place.y, 0.0)
            turn = np.array(((cos, -sin, 0), (sin, cos, 0), (0, 0, 1)))
            mujoco.mju_mat2Quat(pose[3:], (turn @ rest.rotation).ravel())
            for side in SIDES:
                self.data.joint(side).qpos = MAX_GAP / 2
            self.drive, self._goals, self._setpoints = Drive(), dict.fromkeys(AXES, 0.0), dict.fromkeys(AXES, 0.0)
            self._shake = (0.0, 0.0)  # acceleration [m/s²], until [s]
            self._pull = (0.0, 0.0, 0.0, 0.0)  # speed [m/s], force [N], first height [m] and time [s] of what pulls
            self.outcome, self._level, self.most_force = Outcome.FREE, 0.0, 0.0
            mujoco.mj_forward(self.model, self.data)
            self._observe()

    def command(self, command: Command) -> None:
        """Let the gripper go, DELAY later."""
        with self.lock:
            self.drive.put(self.now, command)

    def stop_gripper(self) -> None:
        """Let the gripper stay where it is, DELAY later, with the force that it has."""
        with self.lock:
            self.drive.put(self.now, None)

    def move(self, **goals: float) -> None:
        """Send the hand to ``x``, ``y``, ``lift`` [m], ``yaw`` [rad] at its SPEEDS. Raises InputError for others."""
        if not goals.keys() <= SPEEDS.keys() or not np.isfinite([*goals.values()]).all():
            raise InputError('move of the hand', expected=f'finite {", ".join(AXES)}', got=f'{goals}',
                             remedy='Name these.')
        with self.lock:
            self._goals |= goals

    def shake(self, times_gravity: float = 2.0, seconds: float = 1.0) -> None:
        """Shake the hand up and back, with an acceleration of up to ``times_gravity``."""
        periods = max(1, round(seconds * SHAKE_FREQUENCY))  # whole ones: it ends where it began, at rest
        with self.lock:
            self._shake = (times_gravity * GRAVITY, self.now + periods / SHAKE_FREQUENCY)

    def pull(self, speed: float, force: float) -> None:
        """Pull the item down by a spring whose end sinks at ``speed`` [m/s], with at most ``force`` [N]."""
        with self.lock:
            self._pull = (speed, force, float(self.data.body('item').xpos[2]), self.now)

    @property
    def is_moving(self) -> bool:
        """Whether the hand is under way, or shaken."""
        return self._goals != self._setpoints or self.now < self._shake[1]

    @property
    def now(self) -> float:
        """Time of the physics [s]."""
        return float(self.data.time)

    @property
    def gap(self) -> float:
        """Distance of the skins [m]."""
        return float(sum(self.data.joint(side).qpos[0] for side in SIDES))

    @property
    def gap_speed(self) -> float:
        return float(sum(self.data.joint(side).qvel[0] for side in SIDES))

    @property
    def effort(self) -> float:
        """With which the motor closes, of each pad [N]."""
        with self.lock:
            return -float(sum(self.data.actuator(side).force[0] for side in SIDES)) / 2

    @property
    def forces(self) -> dict[str, float]:
        """With which each pad presses the item, by side [N]."""
        with self.lock:
            return dict(self._forces)

    def item_in(self, side: str) -> Transform:
        """Pose of the item in a pad's frame."""
        with self.lock:
            site, body = self.data.site(f'{side}_pad'), self.data.body('item')
            pad = Transform(site.xmat.reshape(3, 3).copy(), site.xpos.copy())
            return pad.inverse @ Transform(body.xmat.reshape(3, 3).copy(), body.xpos.copy())

    def off_hand(self) -> Place:
        """Where the item is from the middle between the pads, along the hand's axes: what is to be corrected."""
        with self.lock:
            hand, body = self.data.body('hand'), self.data.body('item')
            x, y, _ = hand.xmat.reshape(3, 3).T @ (body.xpos - hand.xpos)
            turn = hand.xmat.reshape(3, 3).T @ body.xmat.reshape(3, 3) @ self.item.rest.rotation.T
        return Place(float(x), float(y), float(np.arctan2(turn[1, 0], turn[0, 0])))

    def pressures(self, side: str) -> np.ndarray:
        """What the taxels of the left or right pad feel [Pa], shape (rows, cols)."""
        with self.lock:
            pose, force = self.item_in(side), self._forces[side]
            if self._has_sensors:
                return by_depth(self.data.sensor(side).data[:ROWS**2].reshape(ROWS, ROWS), force)
        return pressures(self.item, pose, force)

    def step(self, seconds: float) -> None:
        """Let so much time of the physics pass, as fast as it can be computed."""
        with self.lock:
            for _ in range(round(seconds / STEP)):
                self._step()

    def start(self) -> None:
        """Step in a thread, in real time, until ``stop``."""
        self._stopping.clear()
        self._running = threading.Thread(target=self._run, name='physics', daemon=True)
        self._running.start()

    def stop(self) -> None:
        self._stopping.set()
        if self._running is not None:
            self._running.join()

    def _run(self) -> None:
        done = time.monotonic()
        while not self._stopping.wait(LOOP_PERIOD):
            behind = time.monotonic() - MOST_BEHIND - done
            if behind > 0:
                self.left_out += behind
                done += behind
            while done < time.monotonic():
                with self.lock:
                    self._step()
                done += STEP

    def _step(self) -> None:
        for axis in AXES:
            most = SPEEDS[axis] * STEP
            self._setpoints[axis] += min(max(self._goals[axis] - self._setpoints[axis], -most), most)
            self.data.actuator(axis).ctrl = self._setpoints[axis] + (self._shaken() if axis == 'lift' else 0.0)
        left, right = (self.data.joint(side) for side in SIDES)
        position, speed = (float(left.qpos[0] + right.qpos[0]) / 2, float(left.qvel[0] + right.qvel[0]) / 2)
        force = self.drive.force(self.now, STEP, position, speed)
        for side in SIDES:
            self.data.actuator(side).ctrl = force
        self.data.body('item').xfrc_applied[2] = -self._pulled()
        mujoco.mj_step(self.model, self.data)
        self._observe()

    def _shaken(self) -> float:
        """How far the hand is to be from where it rests [m]."""
        acceleration, until = self._shake
        if self.now >= until:
            return 0.0
        rate = 2 * pi * SHAKE_FREQUENCY
        return acceleration / rate**2 * (1 - float(np.cos(rate * (until - self.now))))

    def _pulled(self) -> float:
        """Return the force that pulls the item down now [N]."""
        speed, most, height, begin = self._pull
        stretched = float(self.data.body('item').xpos[2]) - height + speed * (self.now - begin)
        return min(max(PULL_STIFFNESS * stretched, 0.0), most)

    def _observe(self) -> None:
        """Sum the normal forces of the contacts, and judge what has become of the item."""
        self._forces, is_on_table, wrench = dict.fromkeys(SIDES, 0.0), False, np.zeros(6)
        for number in range(self.data.ncon):
            geoms = set(self.data.contact[number].geom.tolist())
            if self._geom not in geoms:
                continue
            mujoco.mj_contactForce(self.model, self.data, number, wrench)
            other = (geoms - {self._geom}).pop()
            if other in self._skins:
                self._forces[self._skins[other]] += float(wrench[0])
            elif not self.model.geom_bodyid[other]:  # of the world, which does not move
                is_on_table |= bool(wrench[0] > 0)
        self.most_force = max(self.most_force, *self._forces.values())
        self.outcome = self._judged(is_on_table)

    def _judged(self, is_on_table: bool) -> Outcome:
        if self.most_force > self.item.strength:
            return Outcome.BROKEN
        lift, before = float(self.data.joint('lift').qpos[0]), self.outcome
        is_gripped = min(self._forces.values()) > 0
        if before is Outcome.DROPPED or before is Outcome.HELD and is_on_table and lift > self._level + LIFTED:
            return Outcome.DROPPED
        if is_on_table:
            self._level = lift
            return Outcome.GRIPPED if is_gripped else Outcome.FREE
        return Outcome.HELD if is_gripped or before is Outcome.HELD else Outcome.FREE
