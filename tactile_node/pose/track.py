"""Whether a measured place stays or moves: it is compared to where it was while it stayed.

The reference is the mean of REFERENCE_TIME, as long ago as a movement of SLOWEST takes to be seen: what is slower, like
a drift, the reference follows. The place moves once it is farther from there than a step, and than its noise explains,
in two frames in a row or clearly in one; a single frame that is elsewhere is forgotten. It stays again once it has
stayed for STOPPED, or for the time in which what moved so slowly would have been seen to go on.
"""

import math
from collections import deque
from typing import NamedTuple

SLOWEST = 0.0004      #: speed that is seen [m/s]
REFERENCE_TIME = 0.3  #: [s]
STOPPED = 0.3         #: [s]
FEWEST = 3            #: places of a reference
CERTAINTY = 5.0       #: standard deviations that noise does not explain: there are thousands of frames
CLAIMED, PRIOR = 0.5, 4  #: part of a standard deviation that is noise, not the fit's; places that it counts for
CLEARLY = 1.6         #: so many times what it must exceed, one frame is enough
GOES_ON = 0.5         #: part of a step that a moving place must go in the time after which it counts as stopped
FORCE_TIME = 0.5      #: of the force that a step is compared to [s]
FORCE_STEP, LEAST_FORCE_STEP = 0.35, 0.05  #: part of the force before, and at least [N]
STAYED = 1 / 6        #: of a step: what moves on, comes farther between the first and the last third of the time


class Place(NamedTuple):
    """A place at one time: [s], [m], and the load there, in any unit."""

    time: float
    x: float
    y: float
    load: float


class Track:
    """Follows one place; takes it in the order of times."""

    def __init__(self, step: float, certainty: float = CERTAINTY):
        self._step, self._certainty = step, certainty
        self._lag = step / SLOWEST
        self.restart()

    def restart(self) -> None:
        """Forget where it was and that it moves."""
        self.is_moving = False
        self.probability = 0.0  #: that it has moved by half a step, in the last frame
        self._hold = STOPPED
        self.forget()

    def forget(self) -> None:
        """Forget where it was: another measure of it begins."""
        self._recent: deque[Place] = deque()
        self._reference: deque[Place] = deque()
        self._sums = [0.0] * 4  # sums of x, y and both squares, from the first place, and of the load
        self._first = Place(math.nan, 0.0, 0.0, 0.0)
        self._was_over: tuple[float, float] | None = None

    @property
    def is_known(self) -> bool:
        """Whether it can be said that it stays or moves."""
        return self.is_moving or len(self._reference) >= FEWEST

    @property
    def load_before(self) -> float:
        """Mean load of the reference; 0: not known."""
        return self._sums[3] / len(self._reference) if self._reference else 0.0

    @property
    def velocity(self) -> tuple[float, float]:
        """By a line through the last places, x and y [m/s]; NaN: too few of them."""
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
        """Size of the velocity [m/s]."""
        return math.hypot(*self.velocity)

    @property
    def direction(self) -> float:
        """Direction of the velocity, x to y [rad]."""
        x, y = self.velocity
        return math.atan2(y, x)

    def update(self, time: float, x: float, y: float, sd: float, slack: float = 0.0,
               load: float = 0.0) -> None:
        """Take a place [m] with its standard deviation.

        ``slack`` [m]: by which the place may be wrong for another reason, beside the step.
        """
        place = Place(time, x, y, load)
        self._recent.append(place)
        if math.isnan(self._first.time):
            self._first = place
        if self.is_moving:
            self._look_for_stop(time)
            return
        self._let_follow(time)
        if len(self._reference) >= FEWEST and self._is_away(place, sd, slack):
            self.is_moving = True
            self._hold = max(STOPPED, GOES_ON * self._step / max(self.speed, SLOWEST))

    def _is_away(self, place: Place, sd: float, slack: float) -> bool:
        count = len(self._reference)
        mean_x, mean_y = self._sums[0] / count, self._sums[1] / count
        squares = max(0.0, self._sums[2] - (mean_x**2 + mean_y**2) * count) / 2
        claimed = 0.0 if math.isnan(sd) else CLAIMED * sd
        error = math.sqrt((squares + PRIOR * claimed**2) / (count - 1 + PRIOR) * (1 + 1 / count))
        away = place.x - self._first.x - mean_x, place.y - self._first.y - mean_y
        distance, limit = math.hypot(*away), max(self._step, self._certainty * error) + slack
        before, self._was_over = self._was_over, away if distance > limit else None
        self.probability = _probability((distance - self._step / 2) / error) if error > 0 else 1.0
        if distance > CLEARLY * limit:
            return True
        if before is None:
            return False
        if self._was_over and before[0] * away[0] + before[1] * away[1] > 0:
            return True
        if len(self._recent) > 1:
            del self._recent[-2]  # it was elsewhere in that frame alone
        return False

    def _let_follow(self, time: float) -> None:
        """Take into the reference what is old enough; at the beginning, the older half of what there is."""
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
        """Return the last places, over a step."""
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
            self.restart()
            self._first = places[0]
            self._recent.extend(places)
            self._let_follow(time)


class ForceTrack:
    """Follows the force of a contact; the reference is the mean of REFERENCE_TIME after each step."""

    def __init__(self) -> None:
        self.last = math.nan  #: [N]
        self.restart()

    def restart(self) -> None:
        """Forget the force before."""
        self.before = math.nan  #: the reference [N]
        self._begin, self._sum, self._count, self._was_over = math.nan, 0.0, 0, 0.0

    def update(self, time: float, force: float, sd: float) -> float:
        """Take a force [N], NaN: not known, and return the probability that it has changed by a step; 0: it has not.

        It is below 0 for less force.
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
