"""Detect events of the contact on one pad, and determine which movements could not be detected.

The events are made, lost, harder, lighter, shifted, returned, sliding and turning.

A load along the pad shifts the pressure in an elastic skin, although nothing slides. A movement is therefore a shift
until it exceeds the largest shift that a load can cause.

Two quantities are tracked in parallel: the outline, if one is fitted, and the centre of pressure. The absence of events
does not prove the absence of slip. The field `observable` tells which movements would be detected. Normal pressure
shows the position of a contact, but not whether the object rolls or slides.
"""

import math
from typing import NamedTuple

import numpy as np

from tactile_node.contact.neighbours import grown
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.visibility import Visibility
from tactile_node.pose.events import Event, EventKind, Motion, Moving, Observable, SeenBy
from tactile_node.pose.fit import ShapeFit
from tactile_node.pose.moments import ContactMoments, principal_axis
from tactile_node.pose.rim import ends_seen, rim_of
from tactile_node.pose.track import ForceTrack, Track


class Sight(NamedTuple):
    """The measurements from one frame with which the contact on a pad is followed."""

    stamp: float  #: acquisition time of the frame [s]
    pattern: ContactPattern
    visibility: Visibility
    moments: ContactMoments
    fit: ShapeFit | None
    none: float   #: probability that nothing touches the pad
    pitch: float  #: distance between neighbouring taxels [m]
    is_on_off: bool


# A movement begins once it exceeds one of these steps, and is a slide once it exceeds the allowed shift by half of this
# step. The steps are smaller than the documented ones (0.4, 0.8, 1.5), because a second frame must confirm a movement.
OUTLINE_STEP = 0.2    #: step of an outline [pitches]
PRESSURE_STEP = 0.55  #: step of a centre of pressure [pitches]
ON_OFF_STEP = 1.1     #: step of an outline or a centre on on/off taxels [pitches]

#: Largest load along the pad under which a contact sticks, as a share of the normal force.
LARGEST_LOAD = 0.5
#: Largest shift under this load, as a share of the contact's extent. The share holds for an elastic layer of any
#: thickness and stiffness and for a Poisson's ratio of up to 0.499 (bench/elastic_layer.py), because the shift grows
#: with the thickness, and so does the extent of a small contact.
SHIFT_OF_EXTENT = 0.15
#: Largest shift of a contact, divided by the load along the pad as a share of the normal force [m]. The largest shift
#: is 2.9 times the thickness of a nearly incompressible skin. This value allows for a skin of 3 mm.
SHIFT_PER_LOAD = 0.0088

#: Number of standard deviations that a turn must exceed. The number is high because fitted angles jump from frame to
#: frame.
TURN_CERTAINTY = 6.0
SLACK = 9.0           #: Number of standard deviations by which a slide alone may change the fitted angle.

#: Shift of a contact's centre while its load grows by a factor of e, as a share of the contact's extent. On an elastic
#: skin, the extent may grow with the square root of the force. If the contact grows at one end only, its centre moves
#: by a quarter of the extent.
GROWTH = 0.25
#: Largest change of load that sliding from taxel to taxel can cause [logarithm of the ratio].
STEADY_LOAD = 0.15
MAX_GAP = 0.25  #: If no frame shows the contact for longer than this, its movement is unknown [s].

#: If the number of taxels changes by more than this factor, a different contact has begun or two contacts have merged.
OTHER_SIZE = 1.6
# A fit describes a different outline if a dimension differs by more than the sum of these two values.
OTHER_LENGTH = 0.2   #: share of the dimension
OTHER_PITCHES = 0.5  #: length [pitches]
OTHER_ANGLE = 0.6    #: A larger change in one frame is no turn, but the fit has chosen another side as its base [rad].

#: A movement along x or y is not observable if the cosine of its angle to an unobservable direction exceeds this value.
HIDES_DIRECTION = 0.5


class MotionFollower:
    """Follows the movement of the contact on one pad, frame by frame.

    Parameters
    ----------
    shift_per_load : float
        Largest shift of a contact that sticks, divided by the load along the pad as a share of the normal force [m].
    """

    def __init__(self, shift_per_load: float = SHIFT_PER_LOAD) -> None:
        self._largest_shift = LARGEST_LOAD * shift_per_load
        self.restart()

    def restart(self) -> None:
        """Forget everything."""
        self._stamp = -math.inf  # stamp of the last frame that showed a contact or an empty pad
        self._was_empty = False  # True if the frame at ``_stamp`` showed an empty pad
        self._contact: _Followed | None = None
        self._last_event: Event | None = None

    def update(self, sight: Sight) -> Motion:
        """Process the next frame, and return the movement of the contact."""
        is_touched = bool(np.count_nonzero(sight.pattern.mask))
        if not (is_touched or sight.visibility.pad_seen):
            return Motion(last_event=self._last_event)
        if not 0 <= sight.stamp - self._stamp <= MAX_GAP:
            self.restart()
        self._stamp = sight.stamp
        motion = self._of_contact(sight) if is_touched else self._of_nothing(sight)
        self._was_empty = not is_touched
        if motion.events:
            self._last_event = motion.events[-1]
        return motion._replace(last_event=self._last_event)

    def _of_nothing(self, sight: Sight) -> Motion:
        before, self._contact = self._contact, None
        if before is None:
            return Motion()
        return Motion(events=(Event(EventKind.LOST, sight.stamp, before.by_pressure, sight.none,
                                    force_before=before.force.last, force=sight.moments.force),))

    def _of_contact(self, sight: Sight) -> Motion:
        if self._contact is None or not self._contact.goes_on(sight.pattern.mask):
            self._contact = _Followed(sight, self._largest_shift)
        motion = self._contact.update(sight)
        if not self._was_empty:
            return motion
        made = Event(EventKind.MADE, sight.stamp, self._contact.by_pressure, 1 - sight.none,
                     force_before=0.0 * sight.moments.force, force=sight.moments.force)
        return motion._replace(events=(made, *motion.events))


class _Followed:
    """Follows one contact, which a load along the pad shifts by no more than ``largest_shift`` [m]."""

    def __init__(self, first: Sight, largest_shift: float):
        self._largest_shift = largest_shift
        self._pitch, self._is_on_off = first.pitch, first.is_on_off
        self.by_pressure = SeenBy.ON_OFF if self._is_on_off else SeenBy.PRESSURE
        of_outline, of_pressure = (ON_OFF_STEP,) * 2 if self._is_on_off else (OUTLINE_STEP, PRESSURE_STEP)
        self._outline = Track(of_outline * first.pitch)
        self._turn = Track(of_outline * first.pitch, TURN_CERTAINTY)
        self._centre = Track(of_pressure * first.pitch)
        self.force = ForceTrack()
        self._mask = first.pattern.mask
        self._hidden = first.pattern.hidden
        self._stamp = -math.inf  # stamp of the last frame that showed the contact's movement
        self._fit: ShapeFit | None = None  # first fit of the current outline
        self._outlined = -math.inf  # stamp of the last fit
        self._angle = self._radius = 0.0
        self._load = 0.0  # force, or area on an on/off skin
        self._extent = 0.0  # larger extent of the contact along rows or columns [m]
        self._moving, self._observable = Moving.NOT_KNOWN, Observable.NOTHING
        self._observed: Sight | None = None  # frame for which ``_observable`` was computed

    def goes_on(self, mask: np.ndarray) -> bool:
        """Return True if ``mask`` overlaps with the followed contact and has a similar size."""
        if mask.shape != self._mask.shape:  # the frames come from another pad
            return False
        before, now = np.count_nonzero(self._mask), np.count_nonzero(mask)
        return bool(max(before, now) <= OTHER_SIZE * min(before, now) + 2 and np.count_nonzero(self._mask & mask))

    def update(self, sight: Sight) -> Motion:
        """Process the next frame of the contact, and return the contact's movement."""
        stamp, moments, fit = sight.stamp, sight.moments, sight.fit
        self._mask = sight.pattern.mask
        if not self._shows_motion(sight):
            return Motion()
        self._stamp = stamp
        events = self._changes_of_force(stamp, moments)
        self._load = moments.area if self._is_on_off else moments.force
        self._extent = self._pitch * max(np.count_nonzero(self._mask.any(axis)) for axis in (0, 1))
        self._centre.update(stamp, *moments.centre_of_pressure, max(moments.centre_of_pressure_sd),
                            self._growth(self._centre), self._load, self._allowed)
        is_whole = not (sight.visibility.outline_hidden or sight.visibility.inside_hidden)
        if fit is not None and is_whole:
            if self._follow_outline(fit, moments, stamp):
                self._centre.restart(self._outline.shift)
                if not self._turn.is_moving:
                    self._turn.restart()
        elif not is_whole or stamp - self._outlined > MAX_GAP:
            self._outline.restart(self._centre.shift)
            self._turn.restart()
        return self._motion(sight, events)

    def _changes_of_force(self, stamp: float, moments: ContactMoments) -> list[Event]:
        changed = self.force.update(stamp, moments.force, moments.force_sd)
        if not changed:
            return []
        kind, before = EventKind.HARDER if changed > 0 else EventKind.LIGHTER, self.force.before
        self.force.restart()
        return [Event(kind, stamp, self.by_pressure, abs(changed), force_before=before, force=moments.force)]

    def _shows_motion(self, sight: Sight) -> bool:
        """Return True if a frame shows the same part of the contact as the previous frames.

        If the hidden taxels near the contact stay different for longer than MAX_GAP, all tracks start again.
        """
        stamp, hidden = sight.stamp, sight.pattern.hidden
        other = hidden ^ self._hidden
        if not math.isfinite(sight.moments.centre_of_pressure[0]):
            return False
        if stamp - self._stamp <= MAX_GAP and np.count_nonzero(other) and np.count_nonzero(other & grown(self._mask)):
            return False
        if not 0 <= stamp - self._stamp <= MAX_GAP:
            for track in (self._outline, self._turn, self._centre, self.force):
                track.restart()
        self._hidden = hidden
        return True

    def _follow_outline(self, fit: ShapeFit, moments: ContactMoments, stamp: float) -> bool:
        """Follow the position and the angle of ``fit``, and return True if the outline has stopped in this frame.

        If a different outline has appeared, the tracks of the position and the angle start again. The tracked position
        is the mean of the fitted centre and the centre of pressure, because a fit tends to stay in its minimum while
        the centre of pressure jumps from taxel to taxel.
        """
        if self._fit is None or not _is_alike(fit, self._fit, self._pitch):
            for track in (self._outline, self._turn):
                track.forget()
            self._fit, self._angle = fit, fit.angle
            self._radius = float(np.hypot(*(fit.outline - fit.centre).T).max())
        self._outlined, had_moved = stamp, self._outline.is_moving
        variance = fit.covariance.diagonal().tolist()
        x, y = ((of_fit + of_pressure) / 2 for of_fit, of_pressure in zip(fit.centre, moments.centre_of_pressure))
        self._outline.update(stamp, x, y, math.sqrt(max(variance[:2])), self._growth(self._outline), self._load,
                             self._allowed)
        if fit.symmetry:
            change = math.remainder(fit.angle - self._angle, 2 * math.pi / fit.symmetry)
            if abs(change) > OTHER_ANGLE:
                self._turn.forget()
            self._angle += change
            sd = math.sqrt(variance[2]) * self._radius  # a slide reveals fit errors that stay constant at rest
            self._turn.update(stamp, self._angle * self._radius, 0.0, sd, SLACK * sd * self._outline.is_moving)
        return had_moved and not self._outline.is_moving

    @property
    def _allowed(self) -> float:
        """Largest shift that a load along the pad can cause [m]."""
        return min(SHIFT_OF_EXTENT * self._extent, self._largest_shift)

    def _growth(self, track: Track) -> float:
        """Return how far the centre of a contact at rest may have shifted because the load changed its size."""
        before = track.load_before
        if not self._load > 0 < before:
            return 0.0
        change = abs(math.log(self._load / before))
        return GROWTH * self._extent * change if change > STEADY_LOAD else 0.0

    def _motion(self, sight: Sight, events: list[Event]) -> Motion:
        before, self._moving = self._moving, self._states()
        has_begun = self._moving & ~before
        speed = direction = rate = math.nan
        if self._moving & (Moving.SHIFTING | Moving.SLIDING):
            by = self._outline if self._outline.is_moving else self._centre
            shown = self._centre if math.isnan(by.speed) else by  # an outline that has just changed has no speed yet
            speed, direction = shown.speed, shown.direction
            if has_begun & Moving.SLIDING:
                by = self._outline if self._outline.is_sliding else self._centre
                events.append(Event(EventKind.SLIDING, sight.stamp, self._seen_by(by), by.probability, speed,
                                    direction))
        elif before & Moving.SHIFTING and self._moving:
            by = self._outline if self._outline.is_known else self._centre
            kind = EventKind.RETURNED if by.has_returned else EventKind.SHIFTED
            events.append(Event(kind, sight.stamp, self._seen_by(by), by.probability))
        if self._moving & Moving.TURNING:
            rate = self._turn.velocity[0] / self._radius
            if has_begun & Moving.TURNING:
                events.append(Event(EventKind.TURNING, sight.stamp, self._seen_by(self._outline),
                                    self._turn.probability, rate=rate))
        if self._observed is None or not _is_seen_alike(sight, self._observed):
            self._observed, self._observable = sight, _observable(sight)
        observable = self._observable
        if self._growth(self._outline if self._outline.is_known else self._centre):
            observable &= Observable.ROTATION
        return Motion(self._moving, speed, direction, rate, observable, tuple(events))

    def _seen_by(self, track: Track) -> SeenBy:
        return self.by_pressure if self._is_on_off else (
            SeenBy.CENTRE_OF_PRESSURE if track is self._centre else SeenBy.OUTLINE)

    def _states(self) -> Moving:
        moving = Moving.NOT_KNOWN
        if self._outline.is_sliding or self._centre.is_sliding:
            moving |= Moving.SLIDING
        elif self._outline.is_moving or self._centre.is_moving:
            moving |= Moving.SHIFTING
        if self._turn.is_moving:
            moving |= Moving.TURNING
        is_known = self._outline.is_known or self._centre.is_known
        return moving or (Moving.STILL if is_known else Moving.NOT_KNOWN)


def _is_alike(fit: ShapeFit, before: ShapeFit, pitch: float) -> bool:
    """Return True if two fits may describe the same outline."""
    if (fit.shape, fit.symmetry, fit.handedness) != (before.shape, before.symmetry, before.handedness):
        return False
    return all(is_bound or abs(length - old) <= OTHER_LENGTH * old + OTHER_PITCHES * pitch
               for length, old, is_bound in zip(fit.dimensions, before.dimensions, fit.is_bound))


def _is_seen_alike(sight: Sight, before: Sight) -> bool:
    """Return True if two frames show the same taxels of the same outline.

    The observable movements are computed only once for such frames, because computing the rim takes most of the time.
    """
    symmetries = [None if each.fit is None else each.fit.symmetry for each in (sight, before)]
    return (symmetries[0] == symmetries[1] and sight.visibility == before.visibility
            and np.array_equal(sight.pattern.mask, before.pattern.mask))


def _observable(sight: Sight) -> Observable:
    """Return the movements of the contact that would be detected if they occurred.

    A movement along an axis of the contact is detectable if at least one end of the contact along this axis is seen.
    """
    fit, seen, found = sight.fit, sight.visibility, Observable.ALONG_X | Observable.ALONG_Y
    if seen.outline_hidden or seen.inside_hidden:
        return Observable.NOTHING
    if fit is not None and fit.symmetry:
        found |= Observable.ROTATION
    if not seen.at_edge:
        return found
    axis = fit.angle if fit is not None else np.nan_to_num(principal_axis(sight.pattern.mask))
    along, across = (any(ends) for ends in ends_seen(rim_of(sight.pattern, seen), float(axis)).tolist())
    if along and across:
        return found
    if not (along or across):
        return Observable.NOTHING
    blind = axis if across else axis + math.pi / 2
    if abs(math.cos(blind)) > HIDES_DIRECTION:
        found &= ~Observable.ALONG_X
    if abs(math.sin(blind)) > HIDES_DIRECTION:
        found &= ~Observable.ALONG_Y
    return found
