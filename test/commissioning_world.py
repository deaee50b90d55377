"""Simulate a gripper on a desk with two pads, blocks and a person, on a virtual clock, for the commissioning.

The world shares no formula with the estimators. A knuckle is a crank that turns about its pivot. A skin is a bed of
springs, so the force on each taxel follows from the overlap of the block with the two skins at this place. The motor
moves in steps of 1 ms, and every command takes effect after a latency.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from tactile_node.commissioning.commissioned_gripper import Act, Question
from tactile_node.commissioning.mistake import Mistake
from tactile_node.commissioning.movement import StopWay
from tactile_node.commissioning.pad_mounting import PLACES
from tactile_node.commissioning.recording import JointStates, PadFrames, PadGrid, Recording

GRID = PadGrid(16, 16, 0.002)
TICK = 0.001            #: Period of the motor [s].
FINE = 5                #: Number of springs along each side of a taxel.
FINGER = 0.003          #: Standard deviation of the pressure under a finger [m].
FACE_DEPTH = 0.006      #: Length of the shorter side of a face of a block [m].
FACES = {0.010: 0.022, 0.025: 0.018, 0.040: 0.014}  #: Length of the face of each gauge block, by its width [m].
FOAM_WIDTH = 0.050      #: Width of the foam [m].
FOAM_FACE = 0.018       #: Length of the face of the foam [m].
FOAM_STIFFNESS = 1000.0  #: Stiffness of the foam without the skins [N/m].
JOINT_NOISE = 5e-6      #: Standard deviation of the joint's noise, as an opening [m].
PLAY = 2e-5             #: Standard deviation of the play of the fingers under load, as an opening [m].
GAUGE_ERROR = 2e-5      #: Standard deviation of the width of a block [m].
GAINS = 0.05            #: Standard deviation of the gain of a taxel.
STALL_SCATTER = 0.02    #: Relative standard deviation of the force at a stall.
RELAX_AFTER = 3.0       #: Time after the last command from which a gripper that relaxes loses force [s].
RELAX_TIME = 8.0        #: Time constant of this loss [s].
PRESS_ERROR = 0.0012    #: Standard deviation of the place of a finger [m].
JIG_ERROR = 1e-4        #: Standard deviation of each coordinate of the block in the jig [m].
#: Axes of a left pad without an error in the frame of the gripper (z to the tip, y to the right pad), as columns.
ALIGNED = np.array(((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)))
JIG_TURN = 3.3e-3       #: Standard deviation of each angle of the block in the jig [rad].


@dataclass(frozen=True)
class Truth:
    """The true properties of one gripper."""

    unit: str                     #: 'm', 'percent' or 'rad'
    gap: Callable[[float], float]  #: opening at the centre of the left pad [m], for a reading
    low: float                    #: limits of the joint
    high: float
    closes_rising: bool
    latency: float                #: shortest time from a command to its effect [s]
    jitter: float                 #: largest additional latency [s]
    braking: float                #: time in which the motor brakes [s]
    step: float                   #: step of the goals, in the unit of the joint
    speed_factor: float
    idle_effort: float            #: effort at which the motor starts to move
    most_effort: float
    most_force: float             #: force at the largest effort [N]
    failing: StopWay
    failing_share: float
    lets_go: bool                 #: True if the gripper lets go of an object when its goal is cancelled
    held_share: float             #: share of the force that remains long after the last command
    stiffness: float              #: force per closing of a block whose face is 18 mm x 6 mm [N/m]
    mounts: tuple[tuple[int, bool], ...]  #: quarter turns, and True if mirrored, of the left and the right pad
    is_swapped: bool
    offset: np.ndarray            #: place of the right pad (x, y) [m]
    turn: float                   #: [rad]
    tilt: np.ndarray              #: change of the opening along x and y [rad]
    faulty: tuple[tuple[tuple[int, int], ...], ...]  #: (row, col) of the faulty taxels of each pad
    noise: float                  #: standard deviation of a taxel at rest [N]
    drift: tuple[float, float]    #: change of the zero of each pad [N/s per taxel]
    losses: float
    frame_period: float
    frame_delay: float
    joint_period: float
    shift_per_load: float         #: [m]
    place: np.ndarray             #: centre of the left pad of the closed gripper, in the frame of the gripper [m]
    axes: np.ndarray              #: axes of the left pad in this frame as columns; x and y seen with the fingertip up

    @property
    def span(self) -> float:
        return self.high - self.low

    def slope(self, reading: float) -> float:
        """Return the change of the opening per unit of the reading [m/reading]."""
        small = 1e-5 * self.span
        return (self.gap(reading + small) - self.gap(reading - small)) / (2 * small)

    def reading(self, gap: float) -> float:
        """Return the reading of an opening [m]."""
        low, high = self.low - 0.2 * self.span, self.high + 0.2 * self.span
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if (self.gap(middle) > gap) == self.closes_rising else (low, middle)
        return (low + high) / 2


def random_truth(rng: np.random.Generator) -> Truth:
    """Draw a gripper."""
    unit = str(rng.choice(('m', 'percent', 'rad')))
    widest = rng.uniform(0.065, 0.1)
    gap, low, high, closes_rising = _random_law(rng, unit, widest)
    span = high - low
    metres = abs((gap(high) - gap(low)) / span)
    angle = rng.uniform(0, 2 * np.pi)
    towards = rng.uniform(0, 2 * np.pi)
    most_effort = float(rng.choice((1.0, 10.0, 40.0, 100.0)))
    other = rng.spawn(1)[0]  # does not change the numbers that follow
    lean = np.append(np.radians(other.uniform(-1.5, 1.5, 2)), np.radians(other.uniform(-3, 3)))
    return Truth(
        unit, gap, low, high, closes_rising, latency=rng.uniform(0.01, 0.2), jitter=rng.uniform(0, 0.005),
        braking=rng.uniform(0, 0.04), step=float(np.exp(rng.uniform(*np.log((5e-5, 1e-3))))) / metres,
        speed_factor=rng.uniform(0.9, 1.1), idle_effort=most_effort * rng.uniform(0.02, 0.08), most_effort=most_effort,
        most_force=rng.uniform(30, 80), failing=StopWay(rng.choice([way.value for way in StopWay])),
        failing_share=rng.uniform(0.3, 0.7), lets_go=bool(rng.random() < 0.25),
        held_share=float(rng.choice((1.0, rng.uniform(0.3, 0.6)))),
        stiffness=float(np.exp(rng.uniform(*np.log((1e3, 2e4))))),
        mounts=tuple((int(rng.integers(4)), bool(rng.random() < 0.3)) for _ in range(2)),
        is_swapped=bool(rng.random() < 0.3),
        offset=rng.uniform(0, 0.005) * np.array((np.cos(angle), np.sin(angle))),
        turn=np.radians(rng.uniform(-3, 3)),
        tilt=np.radians(rng.uniform(0, 3)) * np.array((np.cos(towards), np.sin(towards))),
        faulty=tuple(_random_faulty(rng) for _ in range(2)), noise=rng.uniform(0.002, 0.005),
        drift=(rng.normal(0, 1e-5), rng.normal(0, 1e-5)), losses=float(rng.choice((0.0, rng.uniform(0, 0.02)))),
        frame_period=float(rng.choice((0.01, 0.02))), frame_delay=rng.uniform(0.003, 0.02),
        joint_period=float(rng.choice((0.008, 0.01, 0.02))), shift_per_load=rng.uniform(0.002, 0.006),
        place=np.array((0, 0, 0.12)) + other.uniform(-0.005, 0.005, 3),
        axes=ALIGNED @ Rotation.from_rotvec(lean).as_matrix())


def _random_law(rng: np.random.Generator, unit: str, widest: float) -> tuple[Callable[[float], float], float, float,
                                                                            bool]:
    """Return the opening over the reading, the limits of the joint, and True if the gripper closes as it rises."""
    narrowest = -0.002
    if unit == 'rad':
        crank, start = rng.uniform(0.05, 0.07), rng.uniform(0.5, 0.9)
        arm = crank * np.array((math.cos(start), math.sin(start)))
        pivot = widest / 2 - arm[0]

        def turned(reading: float) -> float:
            finger = math.cos(reading) * arm[0] - math.sin(reading) * arm[1]  # place of the finger beside its pivot
            return 2 * (pivot + finger)
        end = 0.0
        while turned(end) > narrowest:
            end += 1e-4
        return turned, 0.0, end, True
    closes_rising = bool(unit == 'percent' and rng.random() < 0.5)
    span = 100.0 if unit == 'percent' else (widest - narrowest) / float(rng.choice((1.0, 2.0)))
    low = 0.0 if unit == 'percent' else rng.uniform(-0.01, 0.01)
    ends = (widest, narrowest) if closes_rising else (narrowest, widest)
    return lambda reading: ends[0] + (ends[1] - ends[0]) * (reading - low) / span, low, low + span, closes_rising


def _random_faulty(rng: np.random.Generator) -> tuple[tuple[int, int], ...]:
    count = int(rng.integers(0, 4))
    places = rng.choice(GRID.rows * GRID.cols, count, replace=False)
    return tuple((int(place) // GRID.cols, int(place) % GRID.cols) for place in places)


@dataclass
class FlatObject:
    """An object with two parallel flat faces between the pads."""

    width: float
    length: float
    depth: float
    x: float
    y: float
    angle: float
    share: float = 1.0   #: stiffness, as a share of that of a hard block
    #: slopes of the block along x and y against the middle between the pads [rad]
    skew: np.ndarray = field(default_factory=lambda: np.zeros(2))
    slides: float = 0.0  #: speed along y [m/s]
    number: int = 0      #: number of the object, which tells objects apart


@dataclass
class Finger:
    """A finger that presses one physical pad (0 is left) from ``start`` to ``end``."""

    pad: int
    x: float
    y: float
    force: float
    start: float
    end: float


@dataclass
class _Motion:
    """The state of the motor."""

    reading: float
    speed: float = 0.0      # present speed, with its sign
    wanted: float = 0.0     # speed of the goal
    target: float | None = None
    effort: float = 0.0
    stall: float = 0.0      # force at which the motor stalls [N]
    brakes: float = 0.0     # deceleration while the motor brakes, or 0
    commands: list = field(default_factory=list)  # (time of effect, reading at the command, goal or None for a cancel)


class CommissioningDesk:
    """The gripper, the pads and the person."""

    def __init__(self, truth: Truth, rng: np.random.Generator, mistakes: tuple[Mistake, ...] = ()):
        self.truth, self._rng = truth, rng
        self.mistakes = list(mistakes)  #: mistakes that the person still makes, each of them once
        self.questions: list[Question] = []
        self.commands: list[tuple[float, float, float]] = []  #: positions, efforts and speeds that were commanded
        self.cancels = 0
        self._time = 100.0
        self._motion = _Motion(truth.low + (0.3 if truth.closes_rising else 0.7) * truth.span)
        self._object: FlatObject | None = None
        self._weight = 0.0
        self._fingers: list[Finger] = []
        self._gains = 1 + GAINS * rng.standard_normal((2, GRID.rows, GRID.cols))
        self._zero = 0.01 * rng.standard_normal((2, GRID.rows, GRID.cols))
        self._widths = {width: width + GAUGE_ERROR * rng.standard_normal() for width in FACES}
        self._sequences = [0, 0]
        self._frame_at, self._joint_at = self._time, self._time
        self._pending: list[tuple[float, int, tuple]] = []
        self._last_command, self._play = self._time, 0.0
        self._is_off = self._is_stopped = self._is_other_joint = False
        self._other_client_until = -math.inf
        self._consented_gap = math.nan
        self._pulls, self._pulled = False, None  # True before the person pulls the object out, and the object then
        self._springs = [self._springs_of(number) for number in (0, 1)]
        self._images: tuple[object, list[np.ndarray]] = (None, [])
        self._table: tuple = (None, np.zeros(1), np.zeros(1))  # forces over openings
        self._faces: dict[int, tuple] = {}
        self._weighed_force = math.nan
        self._objects = 0
        self.weight = 5.0   #: load of the weight that the person hangs [N]
        self.strongest = 0.0  #: largest true force on a pad since it was last set to 0 [N]
        other = rng.spawn(1)[0]  # does not change the numbers that follow
        block = truth.place + truth.axes[:, :2] @ (truth.offset / 2 + other.uniform(-0.001, 0.001, 2))
        errors = JIG_ERROR * other.standard_normal(3)
        #: pose of the block in the jig in the frame of the gripper, as the person states it. The jig holds the block
        #: along x and z, and the person measures y.
        self.jig = *(block + errors), 0.0, 0.0, 0.0
        self._jig_block = block
        self._jig_turn = Rotation.from_rotvec(JIG_TURN * other.standard_normal(3))

    def _springs_of(self, pad: int) -> np.ndarray:
        """Return the place of each spring of a pad in the frame of the left pad, (rows, cols, FINE^2, 2) [m]."""
        turns, is_mirrored = self.truth.mounts[pad]
        fine = (np.arange(FINE) + 0.5) / FINE - 0.5
        row, col, down, right = np.meshgrid(np.arange(GRID.rows), np.arange(GRID.cols), fine, fine, indexing='ij')
        u = (col + right - (GRID.cols - 1) / 2) * GRID.pitch * (-1 if is_mirrored else 1)
        v = (row + down - (GRID.rows - 1) / 2) * GRID.pitch
        angle = np.pi / 2 * turns
        x, y = np.cos(angle) * u - np.sin(angle) * v, np.sin(angle) * u + np.cos(angle) * v
        if pad == 1:  # this pad faces the left one
            cos, sin = math.cos(self.truth.turn), math.sin(self.truth.turn)
            x, y = self.truth.offset[0] - cos * x - sin * y, self.truth.offset[1] - sin * x + cos * y
        return np.stack((x, y), axis=-1).reshape(GRID.rows, GRID.cols, FINE ** 2, 2)

    # ---- the gripper ----

    def now(self) -> float:
        return self._time

    def serial_numbers(self) -> tuple[str, str]:
        return ('1002', '1001') if self.truth.is_swapped else ('1001', '1002')

    def others(self) -> str:
        return 'goals of /other_node' if self._time < self._other_client_until else ''

    def command(self, position: float, effort: float, speed: float) -> None:
        self.commands.append((position, effort, speed))
        self._send((position, effort, speed))

    def cancel(self) -> None:
        self.cancels += 1
        self._send(None)

    def _send(self, goal: tuple[float, float, float] | None) -> None:
        self._last_command = self._time
        effect = self._time + self.truth.latency + self._rng.uniform(0, self.truth.jitter)
        self._motion.commands.append((effect, self._motion.reading, goal))

    def _apply(self, at: float, goal: tuple[float, float, float] | None) -> None:
        motion, truth = self._motion, self.truth
        way = StopWay.CANCEL
        if goal is not None:
            is_near = abs(goal[0] - at) < 0.03 * truth.span
            way = StopWay.GOAL if is_near else StopWay.REVERSE
        moves_on = goal is not None and (goal[0] - motion.reading) * motion.speed > 0 and way is StopWay.REVERSE
        if motion.speed and not moves_on and way is truth.failing and self._rng.random() < truth.failing_share:
            return
        if motion.speed:
            motion.brakes = abs(motion.speed) / max(truth.braking, TICK) if not moves_on else 0.0
        if goal is None:
            motion.target = None
            if truth.lets_go:
                motion.stall = 0.0
            return
        position, effort, speed = goal
        if self._is_stopped or effort <= truth.idle_effort:
            return
        motion.target = round(min(max(position, truth.low), truth.high) / truth.step) * truth.step
        motion.wanted = speed * truth.speed_factor
        share = (min(effort, truth.most_effort) - truth.idle_effort) / (truth.most_effort - truth.idle_effort)
        motion.effort = effort
        motion.stall = truth.most_force * share * (1 + STALL_SCATTER * self._rng.standard_normal())
        if self._object is not None:
            self._play = PLAY * self._rng.standard_normal() / abs(truth.slope(motion.reading))

    def _tick(self) -> None:
        motion, truth = self._motion, self.truth
        while motion.commands and motion.commands[0][0] <= self._time:
            _, at, goal = motion.commands.pop(0)
            self._apply(at, goal)
        if motion.brakes:
            slower = abs(motion.speed) - motion.brakes * TICK
            motion.speed = math.copysign(max(slower, 0.0), motion.speed)
            if motion.speed == 0:
                motion.brakes = 0.0
        else:
            way = 0.0 if motion.target is None else motion.target - motion.reading
            motion.speed = math.copysign(min(motion.wanted, abs(way) / TICK), way) if way else 0.0
        closing = motion.speed > 0 if truth.closes_rising else motion.speed < 0
        moved = motion.reading + motion.speed * TICK
        if self._object is None:
            motion.reading = moved
            return
        force = self._force(moved)
        if motion.speed and (not closing or force <= motion.stall):
            motion.reading = moved
        elif motion.speed:
            motion.speed = motion.brakes = 0.0
        if self._force(motion.reading) > motion.stall * 1.001 + 1e-3 and not motion.speed:
            motion.reading = self._reading_of_force(motion.stall)
        self.strongest = max(self.strongest, self._force(motion.reading))

    def _is_moving(self) -> bool:
        motion = self._motion
        if motion.commands and motion.commands[0][0] <= self._time + TICK:
            return True
        if motion.speed or motion.brakes:
            return True
        if motion.target is None or motion.target == motion.reading:
            return self._object is not None and self._force(motion.reading) > motion.stall * 1.002 + 2e-3
        way = motion.target - motion.reading
        closing = (way > 0) == self.truth.closes_rising
        return not (closing and self._object is not None
                    and self._force(motion.reading + math.copysign(motion.wanted * TICK, way)) > motion.stall)

    def _reading_of_force(self, force: float) -> float:
        """Return the reading at which the object presses with a force."""
        assert self._object is not None
        closed, opened = self._motion.reading, self.truth.reading(self._object.width + 0.003)
        for _ in range(50):
            middle = (closed + opened) / 2
            closed, opened = (middle, opened) if self._force(middle) > force else (closed, middle)
        return opened

    def _force(self, reading: float) -> float:
        """Return the force on the left pad [N]."""
        if self._object is None:
            return 0.0
        gap = self.truth.gap(reading)
        if gap > self._object.width + 0.003:
            return 0.0
        key = (self._object.number, self._object.y, self._weight)
        if self._table[0] != key:
            gaps = np.arange(-0.004, self._object.width + 0.0031, 5e-5)
            self._table = key, gaps, np.array([self._pressures(0, each).sum() for each in gaps])
        return float(np.interp(gap, *self._table[1:]))

    # ---- the skins ----

    def _held(self, pad: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the springs under the face of the object, bool, their places, and the share of each that is covered.
        """
        held = self._object
        assert held is not None
        key = (held.number, held.y, self._weight and round(self._relaxed(), 2))
        cached = self._faces.get(pad)
        if cached is None or cached[0] != key:
            springs = self._springs[pad]
            shift = self._shift()
            dx, dy = springs[..., 0] - held.x - shift[0], springs[..., 1] - held.y - shift[1]
            cos, sin = math.cos(held.angle), math.sin(held.angle)
            along, beside = cos * dx + sin * dy, cos * dy - sin * dx
            spring = GRID.pitch / FINE
            share = np.clip((held.length / 2 - np.abs(along)) / spring + 0.5, 0, 1) \
                * np.clip((held.depth / 2 - np.abs(beside)) / spring + 0.5, 0, 1)
            on_face = share > 0
            cached = (key, on_face, springs[on_face], share[on_face])
            self._faces[pad] = cached
        return cached[1:]

    def _shift(self) -> np.ndarray:
        """Return how far the weight shifts the contacts [m]. The weight pulls along -y."""
        if not self._weight:
            return np.zeros(2)
        return np.array((0.0, -self.truth.shift_per_load * self._weight / 2
                         / (self._weighed_force * round(self._relaxed(), 2))))

    def _pressures(self, pad: int, gap: float) -> np.ndarray:
        """Return the force of each spring on the face of the object [N]."""
        held = self._object
        assert held is not None
        _, places, share = self._held(pad)
        overlap = held.width - gap - places @ self.truth.tilt
        if held.skew.any():
            overlap = overlap + (2 if pad else -2) * (places - (held.x, held.y)) @ held.skew
        per_spring = self.truth.stiffness / (0.018 * FACE_DEPTH) * (GRID.pitch / FINE) ** 2 * held.share
        return per_spring * share * np.maximum(overlap, 0)

    def _clean(self) -> list[np.ndarray]:
        """Return the force on each taxel of the left and the right pad without noise [N]."""
        pressing = [finger for finger in self._fingers if finger.start <= self._time < finger.end]
        held = self._object
        key = (self._motion.reading, held and (held.number, held.y), self._weight and round(self._relaxed(), 2),
               tuple((finger.pad, finger.start) for finger in pressing))
        if self._images[0] == key:
            return self._images[1]
        images = [np.zeros((GRID.rows, GRID.cols)) for _ in range(2)]
        gap = self.truth.gap(self._motion.reading)
        if held is not None and gap < held.width + 0.003:
            for pad in (0, 1):
                forces = np.zeros((GRID.rows, GRID.cols, FINE ** 2))
                forces[self._held(pad)[0]] = self._pressures(pad, gap)
                images[pad] += forces.sum(-1)
        for finger in pressing:
            # a finger is given in the frame of the pad that it presses
            x = finger.x
            centre = (x, finger.y)
            if finger.pad == 1:
                cos, sin = math.cos(self.truth.turn), math.sin(self.truth.turn)
                centre = (self.truth.offset[0] - cos * x - sin * finger.y,
                          self.truth.offset[1] - sin * x + cos * finger.y)
            distance = ((self._springs[finger.pad] - centre) ** 2).sum(-1)
            blob = np.exp(-distance / (2 * FINGER ** 2)).mean(-1)
            images[finger.pad] += finger.force * blob * GRID.pitch ** 2 / (2 * np.pi * FINGER ** 2)
        self._images = key, images
        return images

    def _relaxed(self) -> float:
        idle = self._time - self._last_command - RELAX_AFTER
        if idle <= 0 or self._object is None:
            return 1.0
        return self.truth.held_share + (1 - self.truth.held_share) * math.exp(-idle / RELAX_TIME)

    def _send_frames(self) -> None:
        truth = self.truth
        for pad, image in enumerate(self._clean()):
            stream = 1 - pad if truth.is_swapped else pad
            self._sequences[pad] += 1
            if self._rng.random() < truth.losses:
                continue
            values = truth.noise * self._rng.standard_normal(image.shape, np.float32) + self._zero[pad]
            values += truth.drift[pad] * (self._time - 100.0)
            if image.any():
                values += self._gains[pad] * image * self._relaxed()
            for row, col in truth.faulty[pad]:
                values[row, col] = self._zero[pad][row, col]
            self._pending.append((self._time + truth.frame_delay, stream,
                                  (self._time, self._sequences[pad], values.astype(np.float32))))

    # ---- the clock ----

    def advance(self, seconds: float) -> Recording:
        """Let time pass, and return what arrives."""
        end = self._time + seconds
        joint: list[tuple[float, float]] = []
        frames: list[list[tuple]] = [[], []]
        while self._time < end - 1e-9:
            before = self._time
            if self._is_moving():
                self._tick()
                self._time += TICK
            else:
                following = [end, self._frame_at, self._joint_at]
                following += [self._motion.commands[0][0] - TICK] if self._motion.commands else []
                self._time = max(self._time, min(following)) if min(following) > self._time else self._time + TICK
            if self._object is not None and self._pulls and self._force(self._motion.reading) > 2.0:
                self._pulls, self._pulled, self._object = False, self._object, None
            if self._object is not None and self._object.slides and self._force(self._motion.reading):
                self._object.y += self._object.slides * (self._time - before)
            if self._time >= self._joint_at:
                self._joint_at += self.truth.joint_period
                if not self._is_off:
                    joint.append((self._time, self._shown()))
            if self._time >= self._frame_at:
                self._frame_at += self.truth.frame_period
                self._send_frames()
            while self._pending and self._pending[0][0] <= self._time:
                _, stream, frame = self._pending.pop(0)
                frames[stream].append(frame)
        pads = tuple(PadFrames(np.array([frame[0] for frame in each]), np.array([frame[1] for frame in each], int),
                               np.array([frame[2] for frame in each]).reshape(-1, GRID.rows, GRID.cols))
                     for each in frames)
        return Recording(pads, JointStates(*np.array(joint).reshape(-1, 2).T))

    def _shown(self) -> float:
        """Return the position in a joint state."""
        if self._is_other_joint:
            return (self.truth.low + self.truth.high) / 2
        noise = JOINT_NOISE / abs(self.truth.slope(self._motion.reading)) * self._rng.standard_normal()
        return self._motion.reading + noise + (self._play if self._force(self._motion.reading) > 0 else 0.0)

    # ---- the person ----

    def _repeat(self, question: Question) -> str:
        """Follow the remedy."""
        self._is_off = self._is_stopped = self._is_other_joint = False
        self._other_client_until = -math.inf
        self._fingers = []
        self._object, self._pulled = self._object or self._pulled, None
        return 'done'

    def _makes(self, mistake: Mistake) -> bool:
        if mistake in self.mistakes:
            self.mistakes.remove(mistake)
            return True
        return False

    def ask(self, question: Question) -> str:
        self.questions.append(question)
        self._time += 2.0
        self._frame_at = self._joint_at = self._time
        acts = {Act.PRESS: self._press, Act.STROKE: self._stroke, Act.BLOCK: self._insert, Act.FOAM: self._insert,
                Act.OBJECT: self._insert, Act.JIG: self._insert_jig, Act.CLEAR: self._clear, Act.WEIGHT: self._hang,
                Act.LEAVE: self._leave, Act.CONSENT: self._consent, Act.DIRECTION: self._direction,
                Act.REPEAT: self._repeat}
        return acts[question.act](question) if question.act in acts else question.choices[0]

    def _leave(self, question: Question) -> str:
        if self._makes(Mistake.HAND_BETWEEN):
            self._fingers = [Finger(0, 0.0, 0.0, 3.0, self._time + 1.0, self._time + 3.0)]
        return 'done'

    def _press(self, question: Question) -> str:
        pad = ('left', 'right').index(question.pad)
        x, y = (0.75 * half * (GRID.cols - 1) / 2 * GRID.pitch for half in PLACES[question.place])
        if self._makes(Mistake.WRONG_CORNER):
            x, y = -x, -y
        if self._makes(Mistake.WRONG_PAD):
            pad = 1 - pad
        start, end, force = self._time + 0.5, self._time + 2.5, self._rng.uniform(3, 8)
        if self._makes(Mistake.TOO_LIGHT):
            force = 0.4
        if self._makes(Mistake.LET_GO_EARLY):
            end = start + 0.2
        x, y = np.array((x, y)) + PRESS_ERROR * self._rng.standard_normal(2)
        self._fingers = [Finger(pad, x, y, force, start, end)]
        if self._makes(Mistake.TWO_FINGERS):
            self._fingers.append(Finger(pad, x, y - 0.018, force, start, end))
        return 'done'

    def _stroke(self, question: Question) -> str:
        pad = ('left', 'right').index(question.pad)
        places = np.linspace(-0.0135, 0.0135, 8)
        self._fingers = [Finger(pad, x, y, 5.0, self._time + 0.5 + 0.2 * k, self._time + 0.7 + 0.2 * k)
                         for k, (x, y) in enumerate((x, y) for y in places for x in places)]
        return 'done'

    def _insert(self, question: Question) -> str:
        self._fingers = []
        if question.act is Act.BLOCK and self._makes(Mistake.BLOCK_MISSING):
            self._object = None
            return 'done'
        is_foam = question.act is Act.FOAM
        width = question.width
        if question.act is Act.BLOCK and self._makes(Mistake.OTHER_BLOCK):
            width = next(each for each in FACES if each != question.width)
        centre = self.truth.offset / 2 + self._rng.normal(0, 0.0007, 2)
        held = FlatObject(FOAM_WIDTH if is_foam else self._widths[width], FOAM_FACE if is_foam else FACES[width],
                          FACE_DEPTH, *centre, math.radians(self._rng.uniform(-8, 8)),
                          share=FOAM_STIFFNESS / (FOAM_STIFFNESS + self.truth.stiffness) if is_foam else 1.0)
        if question.act is Act.BLOCK and self._makes(Mistake.BLOCK_ASKEW):
            held.skew = np.array((math.radians(5), 0.0))
        if question.act is Act.BLOCK and self._makes(Mistake.BLOCK_SLID):
            held.slides = 0.0005
        self._objects += 1
        held.number = self._objects
        self._object = held
        return 'done'

    def _insert_jig(self, question: Question) -> str:
        """Set the jig with the block on the palm, as `_insert` does with a free block."""
        self._insert(Question(Act.BLOCK, question.text, width=question.width))
        if self._object is not None:
            axes = self.truth.axes.T @ self._jig_turn.as_matrix()  # axes of the block, seen from the left pad
            self._object.x, self._object.y, _ = self.truth.axes.T @ (self._jig_block - self.truth.place)
            self._object.angle = math.atan2(axes[1, 0], axes[0, 0]) % math.pi
            self._object.skew = self._object.skew - axes[:2, 1] / axes[2, 1] - self.truth.tilt / 2
        return 'done'

    def _clear(self, question: Question) -> str:
        self._object, self._weight, self._fingers = None, 0.0, []
        return 'done'

    def _hang(self, question: Question) -> str:
        if not self._makes(Mistake.WEIGHT_MISSING):
            self._weighed_force = self._force(self._motion.reading)
            self._weight = self.weight
        return 'done'

    def _consent(self, question: Question) -> str:
        if question.text.startswith('opening'):
            return 'yes'
        self._consented_gap = self.truth.gap(self._motion.reading)
        if self._makes(Mistake.EMERGENCY_STOP):
            self._is_stopped = True
        if self._makes(Mistake.SWITCHED_OFF):
            self._is_off = True
        if self._makes(Mistake.OTHER_JOINT):
            self._is_other_joint = True
        if question.text.startswith('proof') and self._makes(Mistake.PULLED_OUT):
            self._pulls = True
        if self._makes(Mistake.OTHER_CLIENT):
            self._other_client_until = self._time + 3.0
        if self._object is None and self._makes(Mistake.HAND_BETWEEN):
            self._fingers = [Finger(0, 0.0, 0.0, 3.0, self._time + 1.0, self._time + 3.0)]
        return 'yes'

    def _direction(self, question: Question) -> str:
        if self._is_other_joint:
            return 'opened'
        change = self.truth.gap(self._motion.reading) - self._consented_gap
        self._consented_gap += change
        if abs(change) < 2e-4:
            return 'not moved'
        return 'opened' if (change > 0) != self._makes(Mistake.WRONG_DIRECTION) else 'closed'
