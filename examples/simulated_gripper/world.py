"""The simulated bench: a hand, a gripper and an item on a table, stepped by calls or by a thread in real time."""

import threading
import time
from collections.abc import Iterator
from enum import Enum
from math import pi, radians
from typing import Any, NamedTuple

import numpy as np

from bench.planner_world import PITCH, ROWS
from examples.simulated_gripper.drive import Command, Drive
from examples.simulated_gripper.items import Item
from examples.simulated_gripper.model import MAX_GAP, STEP, model_of
from examples.simulated_gripper.pressures import pressures
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.grasp.frame_tree import Transform

try:
    import mujoco
except ImportError:  # the package does not depend on MuJoCo
    mujoco = None

SIDES = ('left', 'right')
MAX_SHIFT = 0.008         #: largest displacement of an item from the aim of the hand [m]
MAX_TURN = radians(15)    #: largest rotation of an item from the aim of the hand [rad]
SPEEDS = {'x': 0.05, 'y': 0.05, 'lift': 0.05, 'yaw': 0.5}  #: speeds of the hand along its axes [m/s, rad/s]
AXES = tuple(SPEEDS)
LIFTED = 0.01             #: a lifted item counts as dropped if it touches the table after a lift of more than this [m]
GRAVITY = 9.81            #: [m/s²]
SHAKE_FREQUENCY = 6.0     #: [Hz]
LOOP_PERIOD = 0.004       #: period of the thread [s]
PULL_STIFFNESS = 2000.0   #: [N/m]
FINGER = 0.003            #: standard deviation of the pressure under a person's finger [m]
MOST_BEHIND = 0.1         #: longest delay that the thread makes up for; it skips the rest [s]


class Outcome(Enum):
    """State of the item on the bench."""

    FREE = 'free'          #: at most one pad touches the item, which was not dropped
    GRIPPED = 'gripped'    #: both pads and also the table or the stand touch the item
    HELD = 'held'          #: only the two pads touch the item
    DROPPED = 'dropped'    #: the item was held and then lost, and remains dropped until the next placement
    BROKEN = 'broken'      #: a pad exceeded the item's strength, and the item remains broken until the next placement


class Place(NamedTuple):
    """Place of an item relative to the aim of the hand [m, rad]."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


class Finger(NamedTuple):
    """A person's finger on a pad."""

    side: str
    row: float     #: place of the finger's middle
    col: float
    force: float   #: [N]
    until: float   #: simulated time at which the finger leaves the pad [s]


AIM = Place()


def random_place(seed: int) -> Place:
    """Draw a place up to MAX_SHIFT away in any direction, turned by up to MAX_TURN."""
    rng = np.random.default_rng(seed)
    distance, way = MAX_SHIFT * np.sqrt(rng.random()), rng.uniform(0, 2 * pi)
    return Place(float(distance * np.cos(way)), float(distance * np.sin(way)), float(rng.uniform(-MAX_TURN, MAX_TURN)))


class World:
    """One item on the bench. All methods are thread-safe.

    The hand's axes x, lift and y are the axes x, -y and z of the left pad's frame. A yaw turns the hand about -y.

    Parameters
    ----------
    item
        Item on the bench.
    place
        Initial place of the item.

    Raises
    ------
    ConfigurationError
        Raised if MuJoCo is not installed.
    """

    def __init__(self, item: Item, place: Place = AIM):
        if mujoco is None:
            raise ConfigurationError('simulated gripper', expected='MuJoCo', got='no module of that name',
                                     remedy='Install it: pip install -r requirements/bench_physics.txt')
        self._fingers: list[Finger] = []
        self.lock = threading.RLock()  #: locked while the physics advances
        self._load(item)
        self._running: threading.Thread | None = None
        self._stopping = threading.Event()
        self.left_out = 0.0            #: real time that the thread skipped because the machine was too slow [s]
        self.place(place)

    def _load(self, item: Item) -> None:
        self.item = item
        self.model = mujoco.MjModel.from_xml_string(model_of(item))
        self.data = mujoco.MjData(self.model)
        self._geom = self.model.geom('item').id
        self._skins = {self.model.geom(f'{side}_skin').id: side for side in SIDES}

    def exchange(self, item: Item) -> None:
        """Put another item on the stand at the aim, and reset the hand to open and lowered."""
        with self.lock:
            now = self.now
            self._load(item)
            self.data.time = now
            self.place()

    def press(self, side: str, row: float, col: float, force: float = 5.0, seconds: float = 2.5) -> None:
        """Press a pad with a finger. Raises InputError.

        Parameters
        ----------
        side
            left or right.
        row, col
            Place of the finger's middle on the pad, from 0.
        force
            Force [N].
        seconds
            Duration [s].
        """
        if side not in SIDES:
            raise InputError('press', expected=' or '.join(SIDES), got=repr(side), remedy='Name a pad.')
        with self.lock:
            self._fingers = [each for each in self._fingers if each.until > self.now]
            self._fingers.append(Finger(side, row, col, force, self.now + seconds))

    def place(self, place: Place = AIM) -> None:
        """Put an intact item on the stand at ``place``, and reset the hand to open and lowered."""
        with self.lock:
            now = self.now  # keep the simulated time, which must not jump back
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
            self._shake = (0.0, 0.0)  # acceleration [m/s²] of the shake, and time of its end [s]
            self._pull = (0.0, 0.0, 0.0, 0.0)  # speed [m/s], force [N], initial height [m] and time [s] of the pull
            self.outcome, self._level, self.most_force = Outcome.FREE, 0.0, 0.0
            mujoco.mj_forward(self.model, self.data)
            self._observe()

    def command(self, command: Command) -> None:
        """Send a command to the gripper, which executes the command after DELAY."""
        with self.lock:
            self.drive.put(self.now, command)

    def stop_gripper(self) -> None:
        """Stop the gripper after DELAY, with its position and its force unchanged."""
        with self.lock:
            self.drive.put(self.now, None)

    def move(self, **goals: float) -> None:
        """Move the hand to ``x``, ``y``, ``lift`` [m] and ``yaw`` [rad] at SPEEDS. Raises InputError."""
        if not goals.keys() <= SPEEDS.keys() or not np.isfinite([*goals.values()]).all():
            raise InputError('move of the hand', expected=f'finite {", ".join(AXES)}', got=f'{goals}',
                             remedy='Use only these names, with finite values.')
        with self.lock:
            self._goals |= goals

    def shake(self, times_gravity: float = 2.0, seconds: float = 1.0) -> None:
        """Shake the hand up and down, with an acceleration of up to ``times_gravity`` times gravity."""
        periods = max(1, round(seconds * SHAKE_FREQUENCY))  # whole periods let the motion end at rest
        with self.lock:
            self._shake = (times_gravity * GRAVITY, self.now + periods / SHAKE_FREQUENCY)

    def pull(self, speed: float, force: float) -> None:
        """Pull the item down with a spring whose end sinks at ``speed`` [m/s], but with at most ``force`` [N]."""
        with self.lock:
            self._pull = (speed, force, float(self.data.body('item').xpos[2]), self.now)

    @property
    def is_moving(self) -> bool:
        """True while the hand moves or is shaken."""
        return self._goals != self._setpoints or self.now < self._shake[1]

    @property
    def now(self) -> float:
        """Simulated time [s]."""
        return float(self.data.time)

    @property
    def gap(self) -> float:
        """Distance between the skins of both pads [m]."""
        return float(sum(self.data.joint(side).qpos[0] for side in SIDES))

    @property
    def gap_speed(self) -> float:
        return float(sum(self.data.joint(side).qvel[0] for side in SIDES))

    @property
    def effort(self) -> float:
        """Closing force of the motor on each pad [N]."""
        with self.lock:
            return -float(sum(self.data.actuator(side).force[0] for side in SIDES)) / 2

    @property
    def forces(self) -> dict[str, float]:
        """Force with which each pad presses the item, by side [N]."""
        with self.lock:
            return dict(self._forces)

    def item_in(self, side: str) -> Transform:
        """Return the pose of the item in the frame of a pad."""
        with self.lock:
            site, body = self.data.site(f'{side}_pad'), self.data.body('item')
            pad = Transform(site.xmat.reshape(3, 3).copy(), site.xpos.copy())
            return pad.inverse @ Transform(body.xmat.reshape(3, 3).copy(), body.xpos.copy())

    def off_hand(self) -> Place:
        """Return the item's position in the hand frame, relative to the midpoint between the pads."""
        with self.lock:
            hand, body = self.data.body('hand'), self.data.body('item')
            x, y, _ = hand.xmat.reshape(3, 3).T @ (body.xpos - hand.xpos)
            turn = hand.xmat.reshape(3, 3).T @ body.xmat.reshape(3, 3) @ self.item.rest.rotation.T
        return Place(float(x), float(y), float(np.arctan2(turn[1, 0], turn[0, 0])))

    def pressures(self, side: str) -> np.ndarray:
        """Return the taxel values of the pad on ``side``, (rows, cols) [Pa]."""
        with self.lock:
            pose, force, load = self.item_in(side), self._forces[side], self.load(side)
            fingers = self._pressed(side)
        return fingers + pressures(self.item, pose, force, load)

    def load(self, side: str) -> np.ndarray:
        """Return the force along x and y of a pad's frame with which the item pulls the skin [N]."""
        with self.lock:
            total = np.zeros(3)
            for contact, other, wrench in self._contacts():
                if self._skins.get(other) == side:  # the force acts on the second geom
                    force = contact.frame.reshape(3, 3).T @ wrench[:3]
                    total += force if contact.geom[1] == other else -force
            return (self.data.site(f'{side}_pad').xmat.reshape(3, 3).T @ total)[:2]

    def _pressed(self, side: str) -> np.ndarray:
        """Return the pressures of the fingers on a pad, (rows, cols) [Pa]."""
        found = np.zeros((ROWS, ROWS))
        for finger in self._fingers:
            if finger.side == side and finger.until > self.now:
                row, col = (np.exp(-((np.arange(ROWS) - middle) * PITCH / FINGER)**2 / 2)
                            for middle in (finger.row, finger.col))
                found += finger.force * np.outer(row, col) / (2 * pi * FINGER**2)
        return found

    def step(self, seconds: float) -> None:
        """Advance the physics by ``seconds``, as fast as possible."""
        with self.lock:
            for _ in range(round(seconds / STEP)):
                self._step()

    def start(self) -> None:
        """Advance the physics in real time, in a thread that runs until `stop` is called."""
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
        """Return the current displacement of the hand due to shaking [m]."""
        acceleration, until = self._shake
        if self.now >= until:
            return 0.0
        rate = 2 * pi * SHAKE_FREQUENCY
        return acceleration / rate**2 * (1 - float(np.cos(rate * (until - self.now))))

    def _pulled(self) -> float:
        """Return the force that currently pulls the item down [N]."""
        speed, most, height, begin = self._pull
        stretched = float(self.data.body('item').xpos[2]) - height + speed * (self.now - begin)
        return min(max(PULL_STIFFNESS * stretched, 0.0), most)

    def _observe(self) -> None:
        """Sum the normal forces of all contacts, and update the outcome."""
        self._forces, is_on_table = dict.fromkeys(SIDES, 0.0), False
        for _, other, wrench in self._contacts():
            if other in self._skins:
                self._forces[self._skins[other]] += float(wrench[0])
            elif not self.model.geom_bodyid[other]:  # body 0 is the world, which does not move
                is_on_table |= bool(wrench[0] > 0)
        self.most_force = max(self.most_force, *self._forces.values())
        self.outcome = self._judged(is_on_table)

    def _contacts(self) -> Iterator[tuple[Any, int, np.ndarray]]:
        """Yield each contact of the item, the other geom, and the force and torque in the contact's frame."""
        for number in range(self.data.ncon):
            contact, wrench = self.data.contact[number], np.zeros(6)
            geoms = set(contact.geom.tolist())
            if self._geom in geoms:
                mujoco.mj_contactForce(self.model, self.data, number, wrench)
                yield contact, (geoms - {self._geom}).pop(), wrench

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
