"""Taxel values -> contact pattern: what is pressed, with hysteresis, then the contacts, the largest first."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage

from tactile_node.contact.left_over import LeftOver
from tactile_node.contact.neighbours import EIGHT_CONNECTED, grown, pad_seen
from tactile_node.contact.noise_floor import NoiseFloor
from tactile_node.contact.press import PressThresholds, are_on_off
from tactile_node.contact.standing_out import NOISE_SPREADS, StandingOut, Threshold, standing_out
from tactile_node.errors import InputError
from tactile_node.taxel_frame import LEAST_BY_UNIT, ON_OFF_UNIT, PRESS_BY_UNIT, RELEASE_RATIO, read_only

BASELINE_SHARE = 0.1  #: share of what a contact rises above it: less is noise, or the skin's response around a contact
LEAST_COUNTS = 3.0  #: rise of readings in whole counts: idle ones differ by two
HIGHEST_VALUE = 1e150    #: magnitude from which on a number is no value, as if infinite: its square has no float
SMALL_ARRAY = 64  #: taxels of an array that one object may cover, so that too few rest
#: correlation of neighbours on a pad with a contact; without one, in 20,000 frames, at most 0.4
ALIKE_CORRELATION = 0.45
#: share of the mean by which the readings of an evenly pressed pad differ at least, because the gains of taxels differ
EVEN_SHARE = 0.05
MOST_LABELS = 255  #: contacts beyond so many have no label


class ContactPattern(NamedTuple):
    """The taxels pressed together; arrays are read-only, of shape (rows, cols)."""

    mask: np.ndarray    #: bool, the largest contact
    #: float, the frame's values, NaN where a taxel has no valid one or is left over; of an array without a unit, less
    #: what its taxels read at rest where that is not about 0, and less the halo of the contacts
    values: np.ndarray
    contacts: int       #: number of separate contacts seen on the pad, 0 when it is empty or not seen
    labels: np.ndarray  #: uint8, the contact that a taxel belongs to: 1 the largest, 2 the next, ...; 0 none
    sizes: tuple[int, ...]  #: taxels of each label: sizes[0] is that of label 1
    hidden: np.ndarray      #: bool, taxels of the pad without a valid value, or left over
    saturated: np.ndarray   #: bool, taxels at the end of their range: their value is a lower bound
    unmapped: np.ndarray    #: bool, places without a taxel: no part of the pad, as what lies beyond its edge
    noise: np.ndarray       #: float, standard deviation of each taxel at rest [unit of the values]; NaN: not known
    #: no contact stands out of a small array, but neighbours read alike, or all read above 0 and no earlier frame shows
    #: what they read at rest: an object may cover most of it
    is_covered: bool = False
    is_left_over: bool = False  #: all that is pressed is left over: what remains of a contact, however small, is held

    @property
    def may_hide_contact(self) -> bool:
        """True if something may touch the pad although no contact is found."""
        return self.is_left_over or self.is_covered

    @property
    def pad_seen(self) -> bool:
        """Whether no group of hidden taxels has room for a contact of 4: only then do 0 contacts mean an empty pad.

        A pad on which something is left over is not empty.
        """
        return not self.may_hide_contact and pad_seen(self.hidden, self.unmapped)

    @classmethod
    def of(cls, mask: np.ndarray, values: np.ndarray) -> 'ContactPattern':
        """Return the pattern of one contact ``mask``, bool, or none, of a frame ``values``, both (rows, cols).

        >>> ContactPattern.of(np.array([[True, False]]), np.array([[5.0, np.nan]])).hidden.tolist()
        [[False, True]]
        """
        taxels = int(np.count_nonzero(mask))
        nowhere = read_only(np.zeros(mask.shape, bool))
        return cls(mask=mask, values=values, contacts=int(taxels > 0), labels=mask.astype(np.uint8),
                   sizes=(taxels,) if taxels else (), hidden=~np.isfinite(values), saturated=nowhere,
                   unmapped=nowhere, noise=read_only(np.full(mask.shape, np.nan)))


class PatternExtractor:
    """Extracts the contact pattern of successive frames of one pad.

    Pressed is what stands out of the noise, up to where it reads half of its contact's own level (`standing_out`).
    With ``thresholds`` it is what reaches fixed values: a taxel becomes pressed at the press threshold or above and is
    released below the release threshold. ``unit`` of the values, 'Pa', 'N' or '1' (on/off, pressed from 0.5 on);
    None: any. Arrays without a unit of which no value is other than 0 and one more are on/off.
    A bool frame is itself the pressed taxels.

    A taxel without a valid value (NaN, infinite) is not in the pattern, but keeps its hysteresis state for when
    it is valid again. One exception: invalid taxels fully enclosed by the contact are filled in, for a dead
    taxel under an object is no hole of the object.

    Taxels that stay on after their contact is gone are hidden (`LeftOver`): they are no contact, and whether something
    presses there is not known.

    Pressed taxels that face each other across hidden ones, along a row or a column, are one contact: a row that
    was not seen tears no contact apart.

    With ``largest`` False the mask is every pressed taxel of the pad, not the largest contact alone.
    """

    def __init__(self, thresholds: PressThresholds | None = None, *, unit: str | None = None, largest: bool = True):
        self._unit = unit
        self._is_on_off = unit == ON_OFF_UNIT
        self._least = LEAST_BY_UNIT.get(unit or '', 0.0)
        self._floor = NoiseFloor(self._least or np.inf)
        self._largest = largest
        self._left_over = LeftOver()
        self.set_thresholds(thresholds)

    def set_thresholds(self, thresholds: PressThresholds | None) -> None:
        """Find the contact in progress again by ``thresholds``; the noise floor and the left-over taxels stay."""
        if thresholds is None and self._is_on_off:
            press = PRESS_BY_UNIT[ON_OFF_UNIT]
            thresholds = PressThresholds(press, RELEASE_RATIO * press)
        self._thresholds = thresholds
        self._is_free = self._unit is None and thresholds is None
        self._pressed: np.ndarray | None = None
        self._left_over.keep_only_left_over()

    def extract(self, values: ArrayLike, *, saturated: ArrayLike | None = None,
                unmapped: ArrayLike | None = None) -> ContactPattern:
        """Return the contact pattern of a frame, real numbers or bool, shape (rows, cols).

        ``saturated`` and ``unmapped``: bool, of the same shape, as in ContactPattern; None: no such taxel. A frame of
        another shape than the one before starts again without a pressed taxel. Raises InputError for anything else.
        """
        frame = as_frame(values)
        numbers = frame.astype(float, copy=False)
        valid = np.abs(numbers) < HIGHEST_VALUE
        missing = _taxels(unmapped, frame.shape, 'unmapped')
        hidden = ~(valid | missing)
        is_first = self._floor.is_new
        found = self._found(frame, numbers, valid)
        pressed, noise, rest = found.pressed & valid, found.noise, found.rest
        if rest and np.count_nonzero(pressed):
            rise = abs(float(np.median(numbers[pressed])) - rest)
            numbers = numbers - rest if abs(rest) > BASELINE_SHARE * rise else numbers
        if self._is_free and found.halo is not None:
            numbers = numbers - found.halo
        labels, contacts = number_contacts(pressed, hidden)
        is_one = contacts == 1 and not np.count_nonzero(hidden)
        left = np.zeros(frame.shape, bool)
        if self._largest:  # a contact is no smaller for what is not seen of it
            left = self._left_over.update(pressed | self._before(frame.shape) & hidden, is_one) & valid
        is_left = bool(np.count_nonzero(left))
        if is_left:  # what they read is no contact, and hides whether there is one
            valid = valid & ~left
            hidden = hidden | left
            labels, contacts = number_contacts(pressed & ~left, hidden)
        if self._largest:
            mask = _with_enclosed(labels == 1, ~hidden)
            labels[mask] = 1
        else:
            mask = pressed.copy()
        may_cover = self._is_free and not contacts and frame.dtype != bool and frame.size <= SMALL_ARRAY
        return ContactPattern(
            mask=read_only(mask), values=read_only(np.where(valid, numbers, np.nan)), contacts=contacts,
            labels=read_only(labels), sizes=tuple(np.bincount(labels.reshape(-1))[1:].tolist()),
            hidden=read_only(hidden), saturated=read_only(_taxels(saturated, frame.shape, 'saturated') & valid),
            unmapped=read_only(missing), noise=noise,
            is_covered=may_cover and bool(valid.all()) and (are_alike(numbers) or is_first and _are_raised(numbers)),
            is_left_over=is_left and not contacts)

    def _found(self, frame: np.ndarray, values: np.ndarray, valid: np.ndarray) -> '_Found':
        unknown = read_only(np.full(frame.shape, np.nan))
        if frame.dtype == bool:
            return _Found(frame.copy(), unknown)
        if self._is_on_off or self._is_free and are_on_off(values[valid]):
            return _Found(self._above(values, valid), unknown)
        level, noise = self._floor.measure(values, valid)
        if self._thresholds:
            pressed, halo = self._above(values, valid), None
        else:
            least = LEAST_COUNTS if self._is_free and _are_counts(values[valid]) else self._least
            own = self._floor.of_frame
            highest = own.level + NOISE_SPREADS * own.deviation if own.is_known else -np.inf
            pressed, halo = self._standing_out(values, valid, Threshold(level, noise, least, highest))
        self._floor.learn(values, noise, valid & ~grown(grown(pressed)), bool(pressed.any()))
        return _Found(pressed, noise if np.count_nonzero(noise) else unknown, level if self._is_free else 0.0, halo)

    def _above(self, values: np.ndarray, valid: np.ndarray) -> np.ndarray:
        """Return what reaches the thresholds; without any, what is not 0."""
        press = release = float(np.finfo(float).tiny)
        if self._thresholds:
            press, release = self._thresholds.press, self._thresholds.release
        before = self._before(values.shape)
        # Comparisons with NaN are false, as wanted: neither pressed nor released.
        pressed = before & ~(valid & (values < release))
        pressed |= valid & (values >= press)
        self._pressed = pressed
        return pressed.copy()

    def _standing_out(self, values: np.ndarray, valid: np.ndarray, threshold: Threshold) -> StandingOut:
        before = self._before(values.shape)
        found = standing_out(values, valid, threshold, before)
        self._pressed = found.pressed | before & ~valid
        return found

    def _before(self, shape: tuple[int, ...]) -> np.ndarray:
        before = self._pressed
        return np.zeros(shape, bool) if before is None or before.shape != shape else before


class _Found(NamedTuple):
    """Pressed taxels of a frame, before they are divided into contacts."""

    pressed: np.ndarray  #: bool (rows, cols)
    noise: np.ndarray    #: float (rows, cols), NaN where it is not known
    rest: float = 0.0    #: what taxels read at rest; 0 where a unit gives the zero
    halo: np.ndarray | None = None  #: (rows, cols), of the pressed taxels


def are_alike(values: np.ndarray) -> bool:
    """Return whether neighbouring taxels read alike, as under a contact, where noise does not."""
    pairs = np.hstack([(values[:, :-1].ravel(), values[:, 1:].ravel()), (values[:-1].ravel(), values[1:].ravel())])
    pairs = pairs[:, np.isfinite(pairs).all(0)]
    if not pairs.size:
        return False
    pairs = pairs / max(np.abs(pairs).max(initial=0.0), np.finfo(float).tiny)  # their squares have a float
    one, other = pairs - pairs.mean(1, keepdims=True)
    return bool(one @ other > ALIKE_CORRELATION * np.sqrt(one @ one * (other @ other)))


def _are_raised(values: np.ndarray) -> bool:
    """Return True if all taxels read above 0 and differ as under a load, not as little as at rest."""
    spread = values.std()
    return bool(values.min() > NOISE_SPREADS * spread and spread > EVEN_SHARE * values.mean())


def _are_counts(values: np.ndarray) -> bool:
    """Return whether ``values`` are whole numbers."""
    return bool((values == np.rint(values)).all())


def of_contact(pattern: ContactPattern, number: int) -> ContactPattern:
    """Return ``pattern`` with the contact of label ``number``, and the hidden taxels that it encloses, as its mask."""
    if number == 1:
        return pattern
    mask = _with_enclosed(pattern.labels == number, ~pattern.hidden)
    return pattern._replace(mask=read_only(mask))


def number_contacts(pressed: np.ndarray, hidden: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the contact of each taxel, uint8, 1 the largest, 0 none, and the number of contacts.

    A contact is 8-connected; hidden taxels with pressed ones on both sides of their row or column connect. Of equally
    large contacts the first in row-major order comes first; those after MOST_LABELS are counted and have no label.
    """
    connected = pressed | between(pressed, hidden) if np.count_nonzero(hidden) else pressed
    found, contacts = ndimage.label(connected, EIGHT_CONNECTED)
    if contacts <= 1:
        return pressed.astype(np.uint8), contacts
    if connected is not pressed:
        found = found * pressed
    largest_first = np.argsort(-np.bincount(found.reshape(-1))[1:], kind='stable')
    number = np.zeros(contacts + 1, np.uint8)
    number[largest_first[:MOST_LABELS] + 1] = np.arange(1, min(contacts, MOST_LABELS) + 1)
    return number[found], contacts


def between(pressed: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """Return the ``hidden`` taxels of a row or column between two ``pressed`` ones, with only hidden others."""
    left, right, below, above = in_line(pressed, hidden)
    return left & right | below & above


def in_line(pressed: np.ndarray, hidden: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the ``hidden`` taxels whose next taxel that is not hidden is ``pressed``, by the direction of that one.

    Towards lower and higher columns, lower and higher rows.
    """
    below, above = _in_line_along_rows(pressed.T, hidden.T)
    return *_in_line_along_rows(pressed, hidden), below.T, above.T


def _in_line_along_rows(pressed: np.ndarray, hidden: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    cols = hidden.shape[1]
    place = np.arange(cols)
    before = np.maximum.accumulate(np.where(hidden, -1, place), 1)
    after = np.minimum.accumulate(np.where(hidden, cols, place)[:, ::-1], 1)[:, ::-1]
    framed = np.pad(pressed, ((0, 0), (1, 1)))
    return hidden & np.take_along_axis(framed, before + 1, 1), hidden & np.take_along_axis(framed, after + 1, 1)


def _with_enclosed(mask: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Add the groups of invalid taxels with only taxels of ``mask`` around them; the pad's edge is open."""
    if np.count_nonzero(valid) == valid.size:
        return mask
    labels, count = ndimage.label(np.pad(~valid, 1), EIGHT_CONNECTED)
    outside = ~np.pad(mask, 1) & (labels == 0)
    is_open = np.zeros(count + 1, bool)
    is_open[labels[ndimage.binary_dilation(outside, EIGHT_CONNECTED)]] = True
    is_open[0] = True
    return mask | ~is_open[labels[1:-1, 1:-1]]


def as_frame(values: ArrayLike) -> np.ndarray:
    """Return ``values`` as a frame, bool or float, shape (rows, cols); the masked taxels of a masked array are NaN.

    Raises InputError for anything but real numbers or bool of two dimensions, with at least one taxel.
    """
    try:
        frame = np.ma.filled(np.ma.asarray(values, float), np.nan) if np.ma.is_masked(values) else np.asarray(values)
    except (TypeError, ValueError):
        raise _no_frame('rows of unequal length, or no numbers') from None
    if frame.ndim != 2 or not frame.size or frame.dtype.kind not in 'biuf':
        raise _no_frame(f'{frame.dtype}, shape {frame.shape}')
    return frame if frame.dtype == bool else frame.astype(float, copy=False)


def _taxels(given: ArrayLike | None, shape: tuple[int, ...], name: str) -> np.ndarray:
    """Return the taxels of ``given``, none where it is None; always a new array."""
    if given is None:
        return np.zeros(shape, bool)
    taxels = np.array(given)
    if taxels.shape != shape or taxels.dtype != bool:
        raise InputError(f'{name} taxels', expected=f'bool, shape {shape}', got=f'{taxels.dtype}, shape {taxels.shape}',
                         remedy='Pass an array of the shape of the frame, or None.')
    return taxels


def _no_frame(got: str) -> InputError:
    return InputError('taxel frame', expected='real numbers, shape (rows, cols)', got=got,
                      remedy='Pass one frame of one pad.')
