"""Watch a held object while an arm lowers it, and decide when something touches the object.

The callers of this module pass the current time, because the module reads no clock. The module is not a safety function
(ISO 13849, ISO 10218).

If a table takes the weight of an object or pushes it, the load along the pads changes. The load moves the pressure in
the elastic skins (docs/events.md), changes the force on the pads, or turns the object. The rules take a baseline of
each of these quantities while nothing touches the object, and then look for a lasting departure from the baseline. A
shaken hand moves the pressure back and forth, so a departure must last longer than half a swing.

A departure does not tell what touches the object. An object that slips in the hand departs as well. Without a
departure, something may touch the object nevertheless.
"""

import math
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Sequence
from enum import IntEnum, IntFlag
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np

from tactile_node.grasp.tracker import SIDES, GraspContact
from tactile_node.gripper.rules.closing import LOST_AFTER

#: Longest timeout of a goal [s]. If the planner dies, the hold of the gripper waits until the goal ends.
LONGEST_TIMEOUT = 60.0
BASELINE_TIME = 1.5  #: Time over which the baseline is taken [s].
FEWEST = 20          #: Smallest number of frames in a baseline.
#: Time allowed for the first reading of the pads [s]. The node subscribes to them when a goal arrives.
START_TIME = 3.0
BLIND_TIME = 0.5     #: Time without a usable reading after which the goal ends [s].

#: Time for which a departure must last [s]. On a hand that is shaken at 5 Hz or faster, the contact changes sides
#: within this time.
LASTING = 0.15
LEAST_IN_LASTING = 3  #: Smallest number of frames that show a lasting departure.
#: Share of a lasting departure by which each of its frames must depart.
EACH_FRAME = 0.5
#: Smallest departure that is a touch, as a mean over both pads [standard deviations of a single frame]. A table loads
#: both pads. The noise of one pad alone would have to exceed twice this number.
CERTAINTY = 3.0

PLACE_STEP = 0.1     #: Smallest departure of the centre of pressure that counts [pitches].
FORCE_STEP = 0.1     #: Smallest departure of the force that counts [share of the force].
LEAST_FORCE = 0.1    #: Smallest departure of the force that counts [N].
ANGLE_STEP = 0.03    #: Smallest departure of the outline's angle that counts [rad].
#: Largest standard deviation of a single frame in a quiet baseline [smallest departure that counts].
MOST_NOISE = 2.0
#: Time in which the reference may follow a drift by the smallest departure that counts [s]. A skin creeps, and its zero
#: drifts.
DRIFT_TIME = 2.0
# Largest drift from the first third to the last third of a quiet baseline: the larger of these two values.
MOST_DRIFT = 0.6     #: share of the smallest departure that counts; the reference can nearly follow this drift
MOST_JITTER = 0.8    #: number of standard deviations of the noise from frame to frame
TRIMMED = 0.2        #: Share of the values at each end that a mean leaves out, because a single frame may be wrong.
NORMAL = 1.4826      #: Standard deviation of normal noise, divided by its median absolute deviation.


class PutDownOutcome(IntEnum):
    """How a goal to put down an object has ended. PutDown.action uses the same numbers."""

    NOT_KNOWN = 0
    SOMETHING_TOUCHES = 1  #: something that was not there before touches the object: a table, an edge, or a hand
    NO_QUIET_BASELINE = 2  #: during the baseline, the contact moved or drifted, or its force changed
    OBJECT_LOST = 3        #: a pad has lost its contact
    PAD_UNSEEN = 4         #: for BLIND_TIME, a pad was not seen, its reading was old, or it had several contacts
    TIMED_OUT = 5
    CANCELED = 6
    NOT_HELD = 7           #: at the start, the pads did not both touch an object
    DRIFTED = 8            #: a quantity has drifted so far from the baseline that a slow touch may be the cause
    GRIPPER_MOVED = 9      #: another goal moves the gripper
    DUPLICATE = 10         #: another process commands the same gripper or has the same name
    REPLACED = 11          #: a later goal has replaced this one
    REFUSED = 12           #: the goal is invalid


class Sign(IntFlag):
    """Signs of a touch. PutDown.action uses the same numbers."""

    NONE = 0
    SHIFTED = 1        #: the centre of pressure moved along the pad
    FORCE_CHANGED = 2
    TURNED = 4         #: the outline turned

    @property
    def text(self) -> str:
        """The signs as text."""
        texts = {Sign.SHIFTED: 'a contact moved along its pad', Sign.FORCE_CHANGED: 'the force changed',
                 Sign.TURNED: 'a contact turned'}
        return ' and '.join(text for sign, text in texts.items() if sign in self)


class HeldContact(NamedTuple):
    """The contact on one pad."""

    place: tuple[float, float]  #: centre of pressure in the pad frame [m]
    force: float                #: normal force [N], or NaN if not known
    pitch: float                #: distance between neighbouring taxels [m]
    outline: str = ''           #: class of the fitted outline, or '' without a fit
    angle: float = math.nan     #: angle of the fitted outline [rad]
    symmetry: int = 0           #: order of rotational symmetry of the outline; 0 if the outline shows no rotation


Pads: TypeAlias = tuple[HeldContact, HeldContact]  #: Contacts on the left and the right pad.


class HeldReading(NamedTuple):
    """The readings of both pads in one frame."""

    acquired: float        #: acquisition time of the older pad result [s], or -inf if not known
    contact: GraspContact
    pads: Pads | None = None  #: None unless each pad has exactly one contact and no CAN frame was lost
    sequences: tuple[int, int] = (0, 0)  #: sequence numbers of the frames

    def is_new(self, before: tuple[int, int]) -> bool:
        """Return True if both pads were acquired again since the frames with the numbers ``before``."""
        return all(now != then for now, then in zip(self.sequences, before))


NOTHING_READ = HeldReading(-math.inf, GraspContact.NOT_KNOWN)


class Quantity:
    """One quantity of one pad, and its departure from the baseline.

    Parameters
    ----------
    name : str
        Name for people.
    sign : Sign
        Sign of a touch if this quantity departs from its baseline.
    read : callable
        Function that returns the value of a contact, as a vector. NaN means that the contact does not show it.
    baseline : sequence of HeldContact
        Contacts during the baseline, in chronological order. At least FEWEST of them show the quantity.
    step : float
        Smallest departure that counts, in the unit of the quantity.
    """

    def __init__(self, name: str, sign: Sign, read: Callable[[HeldContact], np.ndarray],
                 baseline: Sequence[HeldContact], step: float):
        self.name, self.sign, self._read, self._step = name, sign, read, step
        values = np.array([value for value in map(read, baseline) if np.isfinite(value).all()])
        self._first = self._reference = _middle(values)
        noise = NORMAL * _length(np.median(np.abs(values - self._first), axis=0))
        self._spread = max(noise, step / CERTAINTY)
        third = len(values) // 3
        drift = _length(_middle(values[-third:]) - _middle(values[:third]))
        # The jitter from frame to frame contains no drift, but the noise does.
        jitter = NORMAL * _length(np.median(np.abs(np.diff(values, axis=0)), axis=0)) / math.sqrt(2)
        #: True if the quantity neither drifted nor varied too much during the baseline
        self.is_quiet = noise <= MOST_NOISE * step and drift <= max(MOST_DRIFT * step, MOST_JITTER * jitter)
        self._recent: deque[tuple[float, np.ndarray]] = deque()  # times and departures within LASTING

    @property
    def has_drifted(self) -> bool:
        """True if the reference has drifted as far as a touch would move the quantity."""
        return _length(self._reference - self._first) > CERTAINTY * self._spread

    def departure(self, time: float, contact: HeldContact) -> float:
        """Add the contact of the next frame, and return its lasting departure [standard deviations], or 0."""
        away = self._read(contact) - self._reference
        if not np.isfinite(away).all():
            return 0.0
        if self._recent and _length(away) > 0:
            followed = self._step * max(0.0, time - self._recent[-1][0]) / DRIFT_TIME
            self._reference = self._reference + away * min(1.0, followed / _length(away))
        self._recent.append((time, away))
        while len(self._recent) > LEAST_IN_LASTING and self._recent[1][0] <= time - LASTING:
            self._recent.popleft()
        if len(self._recent) < LEAST_IN_LASTING or self._recent[0][0] > time - LASTING:
            return 0.0
        recent = np.array([each for _, each in self._recent])
        mean = _length(recent.mean(axis=0))
        least = float((recent @ recent.mean(axis=0)).min()) / mean if mean > 0 else 0.0
        return max(0.0, min(mean, least / EACH_FRAME)) / self._spread


class PutDown:
    """Watches a held object, from the baseline to the end of the goal.

    Parameters
    ----------
    now : float
        Time at which the baseline begins [s].
    timeout : float
        Time after which the goal ends without a touch [s].
    max_age : float
        Largest age of a reading [s].

    Attributes
    ----------
    signs : Sign
        Signs of a touch in the latest frame.
    deviations : float
        Largest departure from the baseline with one of these signs, as a mean over both pads [standard deviations of a
        single frame in the baseline].
    reason : str
        Explanation of the outcome, or ''.
    used : int
        Number of frames that were compared with the baseline, or added to it.
    """

    def __init__(self, now: float, timeout: float, max_age: float):
        self._end, self._max_age = now + timeout, max_age
        self.signs, self.deviations = Sign.NONE, 0.0
        self.reason = ''
        self.used = 0
        self._was_held = False
        self._held = now       # time at which both pads last touched the object
        self._usable = now     # time of the last usable reading
        self._sequences: tuple[int, int] | None = None  # sequence numbers of the latest frame
        self._baseline: list[tuple[float, Pads]] = []   # acquisition times and contacts
        self._quantities: list[tuple[int, Quantity]] = []  # number of the pad, and one of its quantities

    @property
    def is_watching(self) -> bool:
        """True if the baseline is complete, so that a touch can be detected."""
        return bool(self._quantities)

    def look(self, now: float, reading: HeldReading, *, is_resting: bool) -> PutDownOutcome | None:
        """Return the outcome that ends the goal, or None to continue.

        Parameters
        ----------
        now : float
            Time [s].
        reading : HeldReading
            Latest readings of the pads.
        is_resting : bool
            True if the gripper is at rest.
        """
        if not is_resting:
            self._baseline.clear()
            if self.is_watching:
                return PutDownOutcome.GRIPPER_MOVED
        is_current = now - reading.acquired <= self._max_age
        end = self._why_lost(now, reading) if is_current else None
        if end is None and is_current and reading.contact is GraspContact.TWO_SIDED and reading.pads is not None:
            self._usable = now
            if is_resting and (self._sequences is None or reading.is_new(self._sequences)):
                self._sequences = reading.sequences
                self.used += 1
                follow = self._watch if self.is_watching else self._take
                end = follow(reading.acquired, reading.pads)
        if end is None and now - self._usable > (BLIND_TIME if self._was_held else START_TIME):
            end = PutDownOutcome.PAD_UNSEEN
        return PutDownOutcome.TIMED_OUT if end is None and now > self._end else end

    def _why_lost(self, now: float, reading: HeldReading) -> PutDownOutcome | None:
        if reading.contact is GraspContact.TWO_SIDED:
            self._was_held, self._held = True, now
        elif reading.contact in (GraspContact.NO_CONTACT, GraspContact.ONE_SIDED):
            if not self._was_held:
                return PutDownOutcome.NOT_HELD
            return PutDownOutcome.OBJECT_LOST if now - self._held > LOST_AFTER else None
        return None

    def _take(self, time: float, pads: Pads) -> PutDownOutcome | None:
        """Add a frame to the baseline, and begin to watch once the baseline is complete and quiet."""
        self._baseline.append((time, pads))
        if time - self._baseline[0][0] < BASELINE_TIME:
            return None
        if len(self._baseline) < FEWEST:
            self.reason = (f'{len(self._baseline)} usable frames in {BASELINE_TIME:g} s, but at least {FEWEST} are '
                           'needed')
            return PutDownOutcome.NO_QUIET_BASELINE
        self._quantities = [(number, quantity) for number, side in enumerate(SIDES)
                            for quantity in _quantities(side, [each[number] for _, each in self._baseline])]
        restless = [each.name for _, each in self._quantities if not each.is_quiet]
        self.reason = f'{" and ".join(restless)} did not stay the same' if restless else ''
        return PutDownOutcome.NO_QUIET_BASELINE if restless else None

    def _watch(self, time: float, pads: Pads) -> PutDownOutcome | None:
        """Compare a frame with the baseline."""
        deviations: defaultdict[Sign, float] = defaultdict(float)
        for number, quantity in self._quantities:
            deviations[quantity.sign] += quantity.departure(time, pads[number]) / len(pads)
        signs = [sign for sign, deviation in deviations.items() if deviation >= CERTAINTY]
        self.signs, self.deviations = Sign(sum(signs)), max((deviations[sign] for sign in signs), default=0.0)
        drifted = [each.name for _, each in self._quantities if each.has_drifted]
        if signs:
            self.reason = f'{self.signs.text}, by {self.deviations:.1f} standard deviations'
            return PutDownOutcome.SOMETHING_TOUCHES
        if not drifted:
            return None
        self.reason = f'{" and ".join(drifted)} drifted'
        return PutDownOutcome.DRIFTED


def _quantities(side: str, contacts: list[HeldContact]) -> list[Quantity]:
    """Return the quantities of one pad that the contacts of the baseline show."""
    pitch = float(np.median([each.pitch for each in contacts]))
    force = float(np.median([each.force for each in contacts]))
    found = [Quantity(f'the place of the contact on the {side} pad', Sign.SHIFTED, _place, contacts,
                      PLACE_STEP * pitch)]
    if math.isfinite(force):
        found.append(Quantity(f'the force on the {side} pad', Sign.FORCE_CHANGED, _force, contacts,
                              max(LEAST_FORCE, FORCE_STEP * force)))
    outline, symmetry = Counter((each.outline, each.symmetry) for each in contacts).most_common(1)[0][0]
    heading = partial(_heading, outline=outline, symmetry=symmetry)
    if symmetry and sum(math.isfinite(heading(each)[0]) for each in contacts) >= FEWEST:
        turned = Quantity(f'the angle of the contact on the {side} pad', Sign.TURNED, heading, contacts, ANGLE_STEP)
        found += [turned] * turned.is_quiet  # a fitted angle may jump although nothing moves
    return found


def _place(contact: HeldContact) -> np.ndarray:
    return np.array(contact.place)


def _force(contact: HeldContact) -> np.ndarray:
    return np.array([contact.force])


def _heading(contact: HeldContact, outline: str, symmetry: int) -> np.ndarray:
    """Return the angle as a vector, which is the same for equivalent angles. Its unit is 1 rad."""
    if (contact.outline, contact.symmetry) != (outline, symmetry):
        return np.full(2, math.nan)
    return np.array((math.cos(symmetry * contact.angle), math.sin(symmetry * contact.angle))) / symmetry


def _middle(values: np.ndarray) -> np.ndarray:
    """Return the mean without the largest and smallest values.

    A median would jump if a quantity jumps back and forth between two values, as the centre of a small contact does.
    """
    left_out = int(TRIMMED * len(values))
    mean: np.ndarray = np.sort(values, axis=0)[left_out:len(values) - left_out].mean(axis=0)
    return mean


def _length(vector: np.ndarray) -> float:
    return math.hypot(*vector)
