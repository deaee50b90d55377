"""Decide whether a measured position is at rest, shifts or slides, by comparing the position with an earlier reference.

The reference is the mean position over REFERENCE_TIME. The reference is old enough for a movement at the speed SLOWEST
to have become detectable. The reference follows a slower movement, such as drift.

A position counts as moving once its distance from the reference exceeds both a step and the noise. Either two
consecutive frames must exceed this limit, or one frame must exceed it clearly. If only a single frame exceeds the
limit, and not clearly, that frame is discarded. A position counts as at rest again after it has stayed the same for
STOPPED. After a slow movement, it must stay the same for the longer time in which such a movement would become
detectable.

A movement is a shift until its distance from the position of rest is half a step larger than the shift that a load
along the pad can cause in an elastic skin. From then on, the movement is a slide, until the position stops. The
position of rest is the position before the first movement, or after a slide. A track therefore adds up the distances of
all movements since then. Drift between the movements moves the position of rest too.
"""

import math
from collections import deque
from typing import NamedTuple, TypeAlias

SLOWEST = 0.0004      #: Slowest detectable speed [m/s].
REFERENCE_TIME = 0.3  #: Time over which the reference is averaged [s].
STOPPED = 0.3         #: Shortest time without movement after which a position counts as stopped [s].
FEWEST = 3            #: Smallest number of positions in a reference.

#: Number of standard deviations that a movement must exceed. The number is high to avoid false alarms in thousands of
#: frames.
CERTAINTY = 5.0
#: Share of a reported standard deviation that is noise from frame to frame. The rest is a constant error of the fit.
CLAIMED = 0.5
PRIOR = 4  #: Weight of the reported noise, expressed as a number of positions.
CLEARLY = 1.6  #: Factor by which a single frame must exceed the limit to prove a movement.
BEYOND = 0.5  #: Share of a step by which a slide must exceed the largest shift.
GOES_ON = 0.5  #: Share of a step that a position must cover within the stopping time to count as moving.
FORCE_TIME = 0.5  #: Time over which the reference of the force is averaged [s].
FORCE_STEP = 0.35  #: Step of the force, as a share of the reference.
LEAST_FORCE_STEP = 0.05  #: Smallest step of the force [N].

#: A position has stopped if it moves less than this share of a step from the first to the last third of the stopping
#: time.
STAYED = 1 / 6

#: A position has returned if it stops within this share of a step. The share is below 1, so that a slow slide that
#: seems to stop after each step still adds up.
RETURNED = 0.5

Displacement: TypeAlias = tuple[float, float]  #: Along x and y [m].
NO_SHIFT: Displacement = 0.0, 0.0


class Place(NamedTuple):
    """A position at one time [s, m], with the load on the contact in any unit."""

    time: float
    x: float
    y: float
    load: float


class Track:
    """Follows one position through measurements in chronological order.

    Parameters
    ----------
    step : float
        Distance that counts as a movement [m].
    certainty : float
        Number of standard deviations that a movement must exceed.
    """

    def __init__(self, step: float, certainty: float = CERTAINTY):
        self._step, self._certainty = step, certainty
        self._lag = step / SLOWEST
        self.restart()

    def restart(self, shift: Displacement = NO_SHIFT) -> None:
        """Forget the reference, and treat the position as at rest, displaced by ``shift`` from its position of rest."""
        self.is_moving = False
        self.is_sliding = False    #: True if the position moves, and has moved farther than a load can shift it
        self.has_returned = False  #: True if the latest movement ended where it began or at the position of rest
        #: probability in the latest frame that the position has moved by half a step, or beyond the allowed shift
        self.probability = 0.0
        self.shift = self._shift_before = shift  #: displacement from the position of rest [m]
        self._error = 0.0   # standard deviation of a position at the beginning of the movement [m]
        self._was_far = False
        self._hold = STOPPED
        self.forget()

    def forget(self) -> None:
        """Forget the reference, because the position is measured differently from now on.

        A movement continues from the displacement that it had reached.
        """
        self._offset: Displacement | None = None  # displacement minus measured position during a movement [m]
        self._recent: deque[Place] = deque()
        self._reference: deque[Place] = deque()
        self._sums = [0.0] * 4  # sums of x, y and x² + y² relative to the first position, and of the load
        self._first = Place(math.nan, 0.0, 0.0, 0.0)
        self._was_over: tuple[float, float] | None = None

    @property
    def is_known(self) -> bool:
        """True if enough frames show whether the position is at rest or moves."""
        return self.is_moving or len(self._reference) >= FEWEST

    @property
    def load_before(self) -> float:
        """Mean load over the reference, or 0 if there is no reference."""
        return self._sums[3] / len(self._reference) if self._reference else 0.0

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity along x and y from a line through the latest positions [m/s], or NaN for too few positions."""
        tail = self._tail()
        count = len(tail)
        if count < 2:
            return math.nan, math.nan
        middle = sum(place.time for place in tail) / count
        spread = sum((place.time - middle)**2 for place in tail)
        if not spread:
            return math.nan, math.nan
        return (sum((place.time - middle) * place.x for place in tail) / spread,
                sum((place.time - middle) * place.y for place in tail) / spread)

    @property
    def speed(self) -> float:
        """Magnitude of the velocity [m/s]."""
        return math.hypot(*self.velocity)

    @property
    def direction(self) -> float:
        """Direction of the velocity, positive from x to y [rad]."""
        x, y = self.velocity
        return math.atan2(y, x)

    def update(self, time: float, x: float, y: float, sd: float, slack: float = 0.0,
               load: float = 0.0, allowed: float = 0.0) -> None:
        """Add the position measured in the next frame.

        Parameters
        ----------
        time : float
            Time of the frame [s].
        x, y : float
            The position [m].
        sd : float
            Standard deviation of the position [m].
        slack : float
            Distance by which the position may change for another reason, such as the growth of a contact [m]. A
            movement must exceed this distance.
        load : float
            Normal load on the contact, in any unit.
        allowed : float
            Distance from the position of rest up to which a load along the pad shifts the position [m]. If ``slack``
            is larger, a movement is a shift up to the distance ``slack`` (docs/events.md).
        """
        place = Place(time, x, y, load)
        self._recent.append(place)
        if math.isnan(self._first.time):
            self._first = place
        if self.is_moving:
            self._look_for_slide(place, max(allowed, slack))
            self._look_for_stop(time)
            return
        self._let_follow(time)
        if len(self._reference) >= FEWEST and self._is_away(place, sd, slack):
            count = len(self._reference)
            self._shift_before = self.shift
            self._offset = (self.shift[0] - self._first.x - self._sums[0] / count,
                            self.shift[1] - self._first.y - self._sums[1] / count)
            self.is_moving = True
            self._look_for_slide(place, max(allowed, slack))
            self._hold = max(STOPPED, GOES_ON * self._step / max(self.speed, SLOWEST))

    def _is_away(self, place: Place, sd: float, slack: float) -> bool:
        count = len(self._reference)
        mean_x, mean_y = self._sums[0] / count, self._sums[1] / count
        squares = max(0.0, self._sums[2] - (mean_x**2 + mean_y**2) * count) / 2
        claimed = 0.0 if math.isnan(sd) else CLAIMED * sd
        error = math.sqrt((squares + PRIOR * claimed**2) / (count - 1 + PRIOR) * (1 + 1 / count))
        away = place.x - self._first.x - mean_x, place.y - self._first.y - mean_y
        distance, limit = math.hypot(*away), max(self._step, self._certainty * error, slack)
        before, self._was_over = self._was_over, away if distance > limit else None
        self._error = error
        self.probability = self._probability_of(distance - self._step / 2)
        if distance > CLEARLY * limit:
            return True
        if before is None:
            return False
        if self._was_over and before[0] * away[0] + before[1] * away[1] > 0:
            return True
        if len(self._recent) > 1:
            del self._recent[-2]  # the position jumped in only that frame
        return False

    def _look_for_slide(self, place: Place, allowed: float) -> None:
        """Treat the movement as a slide once two positions exceed ``allowed`` by half a step, or one by a step."""
        if self._offset is None:  # the position is measured differently since the last frame
            self._offset = self.shift[0] - place.x, self.shift[1] - place.y
        self.shift = self._offset[0] + place.x, self._offset[1] + place.y
        beyond = math.hypot(*self.shift) - allowed
        was_far, self._was_far = self._was_far, beyond > BEYOND * self._step
        if not self.is_sliding and self._was_far and (was_far or beyond > self._step):
            self.is_sliding = True
            self.probability = self._probability_of(beyond)

    def _probability_of(self, distance: float) -> float:
        """Return the probability that a measured ``distance`` [m] is not the noise of the positions."""
        return _probability(distance / self._error) if self._error > 0 else 1.0

    def _let_follow(self, time: float) -> None:
        """Move positions that are old enough into the reference.

        An empty reference receives the older half of all positions.
        """
        begin = self._first.time
        end = max(time - self._lag, min(begin + REFERENCE_TIME, (begin + time) / 2))
        while len(self._recent) > 2 and self._recent[0].time <= end:
            self._reference.append(self._recent.popleft())
            self._add(self._reference[-1], 1)
        while len(self._reference) > FEWEST and self._reference[0].time < end - REFERENCE_TIME:
            self._add(self._reference.popleft(), -1)

    def _add(self, place: Place, sign: int) -> None:
        x, y = place.x - self._first.x, place.y - self._first.y
        for index, value in enumerate((x, y, x * x + y * y, place.load)):
            self._sums[index] += sign * value

    def _tail(self) -> list[Place]:
        """Return the latest positions, back to the first position that is more than one step away."""
        tail: list[Place] = []
        for place in reversed(self._recent):
            tail.append(place)
            if math.hypot(place.x - tail[0].x, place.y - tail[0].y) > self._step:
                break
        return tail

    def _look_for_stop(self, time: float) -> None:
        while len(self._recent) > FEWEST and self._recent[1].time <= time - self._hold:
            self._recent.popleft()
        if len(self._recent) <= FEWEST or self._recent[0].time > time - self._hold:
            return
        third = max(1, len(self._recent) // 3)
        places = list(self._recent)
        first, last = _mean(places[:third]), _mean(places[-third:])
        if math.hypot(last[0] - first[0], last[1] - first[1]) < STAYED * self._step:
            shift, has_returned = self._shift_at_rest(last)
            self.restart(shift)
            self.has_returned = has_returned
            self._first = places[0]
            self._recent.extend(places)
            self._let_follow(time)

    def _shift_at_rest(self, end: Displacement) -> tuple[Displacement, bool]:
        """Return the displacement of a movement that has stopped at ``end``, and True if the position has returned."""
        if self.is_sliding or self._offset is None:
            return NO_SHIFT, False
        shift = self._offset[0] + end[0], self._offset[1] + end[1]
        if math.hypot(*shift) < RETURNED * self._step:
            return NO_SHIFT, True
        return shift, math.dist(shift, self._shift_before) < RETURNED * self._step


class ForceTrack:
    """Follows the force of a contact. The reference is the mean force over FORCE_TIME after each step."""

    def __init__(self) -> None:
        self.last = math.nan  #: latest force [N]
        self.restart()

    def restart(self) -> None:
        """Forget the reference."""
        self.before = math.nan  #: reference [N]
        self._begin, self._sum, self._count, self._was_over = math.nan, 0.0, 0, 0.0

    def update(self, time: float, force: float, sd: float) -> float:
        """Add the force of the next frame, and return the probability that the force has changed by a step.

        Parameters
        ----------
        time : float
            Time of the frame [s].
        force : float
            Force [N], or NaN if the force is unknown.
        sd : float
            Standard deviation of the force [N].

        Returns
        -------
        float
            Probability of a step, negative if the force has fallen, or 0 if the force has not changed by a step.
        """
        self.last = force
        if not math.isfinite(force):
            return 0.0
        if math.isnan(self._begin):
            self._begin = time
        if self._count < FEWEST or time - self._begin <= FORCE_TIME:
            self._sum, self._count = self._sum + force, self._count + 1
            return 0.0
        self.before = self._sum / self._count
        error = 0.0 if math.isnan(sd) else sd
        change, limit = force - self.before, max(FORCE_STEP * self.before, LEAST_FORCE_STEP, CERTAINTY * error)
        over, before = change / limit, self._was_over
        self._was_over = over if abs(over) > 1 else 0.0
        if abs(over) < CLEARLY and not self._was_over * before > 0:
            return 0.0
        probability = _probability((abs(change) - limit / 2) / error) if error else 1.0
        return math.copysign(probability, change)


def _mean(places: list[Place]) -> tuple[float, float]:
    return sum(place.x for place in places) / len(places), sum(place.y for place in places) / len(places)


def _probability(deviations: float) -> float:
    return 0.5 * math.erfc(-deviations / math.sqrt(2))
