"""Extract a contact pattern from taxel values.

The pattern holds the pressed taxels, with hysteresis, numbered by contact with the largest contact first.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage

from tactile_node.contact.left_over import LeftOver
from tactile_node.contact.neighbours import EIGHT_CONNECTED, grown, pad_seen
from tactile_node.contact.noise_floor import NoiseFloor, Resting
from tactile_node.contact.press import PressThresholds, are_on_off
from tactile_node.contact.standing_out import GROUP_TAXELS, HALO_SHARE, NOISE_SPREADS, Threshold, standing_out
from tactile_node.errors import InputError
from tactile_node.taxel_frame import LEAST_BY_UNIT, ON_OFF_UNIT, PRESS_BY_UNIT, RELEASE_RATIO, read_only

#: If the level at rest is below this share of a contact's rise, the level is ignored, because it is noise or the skin's
#: response around a contact.
BASELINE_SHARE = 0.1
LEAST_COUNTS = 3.0     #: Smallest rise of a contact in whole counts. Idle readings differ by up to two counts.
HIGHEST_VALUE = 1e150  #: Values of this magnitude or more are as invalid as infinity, because their squares overflow.

#: Largest number of taxels in an array that one object may cover so completely that too few taxels rest.
SMALL_ARRAY = 64
#: Smallest correlation between neighbouring taxels on a pad with a contact. In 20,000 frames without a contact, the
#: correlation was at most 0.4.
ALIKE_CORRELATION = 0.45
#: Smallest spread of the readings on an evenly pressed pad, as a share of their mean. The gains of real taxels differ
#: by at least this much.
EVEN_SHARE = 0.05
#: Spread of the readings, as a share of their mean, above which a later frame than the first may also show a covered
#: array. The levels at rest of a usable array differ by less.
UNEVEN_SHARE = 0.2
#: Smallest correlation between successive frames under a load. Noise at rest is independent from frame to frame.
LASTING_CORRELATION = 0.5
MOST_LABELS = 255  #: Largest number of contacts that get a label.


class ContactPattern(NamedTuple):
    """The contacts in one frame. All arrays are read-only and have the shape (rows, cols)."""

    mask: np.ndarray  #: bool, True for the taxels of the largest contact

    #: float, values of the frame; NaN where a taxel has no valid value or is left over. If the array has no unit, these
    #: values do not include the halo of the contacts or a level at rest that differs clearly from 0.
    values: np.ndarray
    contacts: int  #: number of separate contacts on the pad; 0 if the pad is empty or not seen

    #: uint8, number of the contact to which a taxel belongs: 1 for the largest contact, 2 for the next, ...; 0 for none
    labels: np.ndarray
    sizes: tuple[int, ...]  #: number of taxels with each label, starting with label 1
    hidden: np.ndarray  #: bool, left-over taxels and other taxels of the pad without a valid value
    saturated: np.ndarray  #: bool, taxels at the end of their range; their values are lower bounds

    #: bool, places without a taxel, which do not belong to the pad
    unmapped: np.ndarray
    noise: np.ndarray  #: float, standard deviation of each taxel at rest [unit of the values]; NaN if it is not known

    #: True if an object may cover most of a small array, so that no contact stands out. A covering object is assumed if
    #: neighbouring taxels have similar readings. A covering object is also assumed if all taxels read above 0 and their
    #: readings differ, until a frame shows the readings at rest.
    is_covered: bool = False
    #: True if all pressed taxels are left over. Something may still press these taxels, even if they are few.
    is_left_over: bool = False

    @property
    def may_hide_contact(self) -> bool:
        """True if something may touch the pad although no contact was found."""
        return self.is_left_over or self.is_covered

    @property
    def pad_seen(self) -> bool:
        """True if the frame shows enough of the pad for 0 contacts to mean an empty pad.

        The frame shows enough if no group of hidden taxels has room for a contact of 4 taxels, and if no taxel is left
        over.
        """
        return not self.may_hide_contact and pad_seen(self.hidden, self.unmapped)

    @classmethod
    def of(cls, mask: np.ndarray, values: np.ndarray) -> 'ContactPattern':
        """Return the pattern of a frame that has one contact or none.

        Parameters
        ----------
        mask : np.ndarray
            Taxels of the contact, bool (rows, cols).
        values : np.ndarray
            Taxel values, float (rows, cols). Taxels whose value is not finite are hidden.

        Examples
        --------
        >>> ContactPattern.of(np.array([[True, False]]), np.array([[5.0, np.nan]])).hidden.tolist()
        [[False, True]]
        """
        taxels = int(np.count_nonzero(mask))
        nowhere = read_only(np.zeros(mask.shape, bool))
        return cls(mask=mask, values=values, contacts=int(taxels > 0), labels=mask.astype(np.uint8),
                   sizes=(taxels,) if taxels else (), hidden=~np.isfinite(values), saturated=nowhere,
                   unmapped=nowhere, noise=read_only(np.full(mask.shape, np.nan)))


class PatternExtractor:
    """Extracts the contact pattern from successive frames of one pad.

    By default, a taxel is pressed if it stands out from the noise. A contact ends where its taxels read less than half
    of the contact's level (`standing_out`). With ``thresholds``, fixed limits decide which taxels are pressed. A taxel
    becomes pressed at or above the press threshold and is released below the release threshold. In a bool frame, True
    marks a pressed taxel.

    An array without a unit is on/off if its values are 0 and at most one other number.

    A taxel without a valid value (NaN, infinite) is not part of the pattern. Such a taxel keeps its hysteresis state
    until its value is valid again. However, a contact includes the invalid taxels that it fully encloses, because a
    dead taxel under an object is not a hole in the object.

    Taxels that stay pressed after their contact is gone are hidden (`LeftOver`). Left-over taxels are not reported as a
    contact, although something may still press them.

    If pressed taxels face each other across hidden taxels along a row or a column, the pressed taxels belong to one
    contact. A row without values therefore does not split a contact.

    Parameters
    ----------
    thresholds : PressThresholds or None
        Fixed thresholds; None to compare the values with the noise.
    unit : str or None
        Unit of the values: 'Pa', 'N' or '1' (on/off, pressed at 0.5 or above); None for any other unit.
    largest : bool
        True if the mask of a pattern contains only the largest contact; False if it contains all pressed taxels of the
        pad.
    """

    def __init__(self, thresholds: PressThresholds | None = None, *, unit: str | None = None, largest: bool = True):
        self._unit = unit
        self._is_on_off = unit == ON_OFF_UNIT
        self._least = LEAST_BY_UNIT.get(unit or '', 0.0)
        self._floor = NoiseFloor(self._least or np.inf)
        self._largest = largest
        self._left_over = LeftOver()
        self._has_rested = False  # True once a frame has shown the readings of some taxels at rest
        self._last_covered: np.ndarray | None = None  # last frame in which an object may cover the array
        self.set_thresholds(thresholds)

    def set_thresholds(self, thresholds: PressThresholds | None) -> None:
        """Apply new thresholds and forget the pressed taxels, but keep the noise floor and the left-over taxels."""
        if thresholds is None and self._is_on_off:
            press = PRESS_BY_UNIT[ON_OFF_UNIT]
            thresholds = PressThresholds(press, RELEASE_RATIO * press)
        self._thresholds = thresholds
        self._is_free = self._unit is None and thresholds is None
        self._pressed: np.ndarray | None = None
        self._left_over.keep_only_left_over()

    def extract(self, values: ArrayLike, *, saturated: ArrayLike | None = None,
                unmapped: ArrayLike | None = None) -> ContactPattern:
        """Return the contact pattern of a frame.

        If the shape of the frame changes, the extractor starts again without pressed taxels.

        Parameters
        ----------
        values : array_like
            Taxel values, real numbers or bool, (rows, cols).
        saturated : array_like or None
            Taxels at the end of their range, bool (rows, cols); None if there are none.
        unmapped : array_like or None
            Places without a taxel, bool (rows, cols); None if there are none.

        Raises
        ------
        InputError
            Raised if an argument has the wrong type or shape.
        """
        frame = as_frame(values)
        numbers = frame.astype(float, copy=False)
        valid = np.abs(numbers) < HIGHEST_VALUE
        missing = _taxels(unmapped, frame.shape, 'unmapped')
        hidden = ~(valid | missing)
        found = self._find_pressed(frame, numbers, valid)
        pressed, rest = found.pressed & valid, found.rest
        if rest and np.count_nonzero(pressed):
            rise = abs(float(np.median(numbers[pressed])) - rest)
            numbers = numbers - rest if abs(rest) > BASELINE_SHARE * rise else numbers
        if self._is_free and found.halo is not None:
            numbers = numbers - found.halo
        labels, contacts = number_contacts(pressed, hidden)
        is_one = contacts == 1 and not np.count_nonzero(hidden)
        left = np.zeros(frame.shape, bool)
        # hidden taxels that were pressed before still count, so that a contact does not seem to shrink
        if self._largest:
            left = self._left_over.update(pressed | self._before(frame.shape) & hidden, is_one) & valid
        is_left = bool(np.count_nonzero(left))
        if is_left:
            valid = valid & ~left
            hidden = hidden | left
            labels, contacts = number_contacts(pressed & ~left, hidden)
        if self._largest:
            mask = _with_enclosed(labels == 1, ~hidden)
            labels[mask] = 1
        else:
            mask = pressed.copy()
        is_covered = not contacts and frame.dtype != bool and self._is_covered(numbers, valid)
        if is_covered:
            self._last_covered = numbers
        elif contacts or valid.all():
            self._has_rested = True
        return ContactPattern(
            mask=read_only(mask), values=read_only(np.where(valid, numbers, np.nan)), contacts=contacts,
            labels=read_only(labels), sizes=tuple(np.bincount(labels.reshape(-1))[1:].tolist()),
            hidden=read_only(hidden), saturated=read_only(_taxels(saturated, frame.shape, 'saturated') & valid),
            unmapped=read_only(missing), is_covered=is_covered, is_left_over=is_left and not contacts,
            noise=read_only(np.full(frame.shape, np.nan)) if found.noise is None else found.noise)

    def _find_pressed(self, frame: np.ndarray, values: np.ndarray, valid: np.ndarray) -> '_PressedTaxels':
        if frame.dtype == bool:
            return _PressedTaxels(frame.copy())
        if self._is_on_off or self._is_free and are_on_off(values[valid]):
            return _PressedTaxels(self._above(values, valid))
        level, noise = self._floor.measure(values, valid)
        if self._thresholds:
            pressed, halo = self._above(values, valid), None
        else:
            least = LEAST_COUNTS if self._is_free and _are_counts(values[valid]) else self._least
            own = self._floor.of_frame
            highest = own.level + NOISE_SPREADS * own.deviation if own.is_known else -np.inf
            threshold = Threshold(level, noise, least, highest)
            if self._is_free and not self._floor.is_followed:
                threshold = _with_raised_rest(threshold, own, values[valid])
            before = self._before(values.shape)
            pressed, halo = standing_out(values, valid, threshold, before)
            self._pressed = pressed | before & ~valid
        self._floor.learn(values, noise, valid & ~grown(grown(pressed)), bool(np.count_nonzero(pressed)))
        rest = level if self._is_free else 0.0
        return _PressedTaxels(pressed, noise if np.count_nonzero(noise) else None, rest, halo)

    def _is_covered(self, values: np.ndarray, valid: np.ndarray) -> bool:
        """Return True if an object may cover a small array without a unit, so that no contact stands out."""
        if not self._is_free or values.size > SMALL_ARRAY or not valid.all():
            return False
        if are_alike(values):
            return True
        is_raised = values.min() > 0 and not (_are_counts(values) and np.ptp(values) < LEAST_COUNTS)
        if self._has_rested or not is_raised:
            return False
        spread = values.std() / values.mean()
        last = self._last_covered
        if last is None or last.shape != values.shape:
            return bool(spread > EVEN_SHARE)
        return bool(spread > UNEVEN_SHARE) and _correlation(values, last) > LASTING_CORRELATION

    def _above(self, values: np.ndarray, valid: np.ndarray) -> np.ndarray:
        """Return the taxels that reach the thresholds. Without thresholds, return the taxels above 0."""
        press = release = float(np.finfo(float).tiny)
        if self._thresholds:
            press, release = self._thresholds.press, self._thresholds.release
        before = self._before(values.shape)
        # A taxel without a valid value is neither pressed nor released, because comparisons with NaN are false.
        pressed = before & ~(valid & (values < release))
        pressed |= valid & (values >= press)
        self._pressed = pressed
        return pressed.copy()

    def _before(self, shape: tuple[int, ...]) -> np.ndarray:
        before = self._pressed
        return np.zeros(shape, bool) if before is None or before.shape != shape else before


class _PressedTaxels(NamedTuple):
    """The pressed taxels of a frame before they are divided into contacts."""

    pressed: np.ndarray              #: bool (rows, cols)
    noise: np.ndarray | None = None  #: float (rows, cols), or None if it is unknown
    rest: float = 0.0                #: level at rest; 0 for an array with a unit, because its zero is known
    halo: np.ndarray | None = None   #: (rows, cols), halo of the pressed taxels


def are_alike(values: np.ndarray) -> bool:
    """Return True if neighbouring taxels have similar readings, as they do under a contact but not in noise."""
    pairs = np.hstack([(values[:, :-1].ravel(), values[:, 1:].ravel()), (values[:-1].ravel(), values[1:].ravel())])
    return _correlation(*pairs) > ALIKE_CORRELATION


def _with_raised_rest(threshold: Threshold, own: Resting, seen: np.ndarray) -> Threshold:
    """Return the threshold of a frame in which a contact may raise the taxels beside it.

    If the resting taxels read little compared with the contact, their level and noise in this frame, ``own``, are used.
    The contact has at least GROUP_TAXELS taxels, because a single high reading may be a stuck taxel. The noise is
    limited, because the readings under the rim of a large object differ as well.
    """
    most = HALO_SHARE * (float(np.partition(seen, -GROUP_TAXELS)[-GROUP_TAXELS]) - threshold.level)
    if own.level - threshold.level > most:
        return threshold
    return threshold._replace(level=own.level, noise=np.maximum(threshold.noise,
                                                                min(own.deviation, most / NOISE_SPREADS)))


def _correlation(one: np.ndarray, other: np.ndarray) -> float:
    """Return the correlation between two arrays where both are finite, or 0 if it is not known."""
    pairs = np.stack([one.ravel(), other.ravel()])
    pairs = pairs[:, np.isfinite(pairs).all(0)]
    if not pairs.size:
        return 0.0
    # the limit prevents the squares of the values from overflowing
    pairs = pairs / max(np.abs(pairs).max(initial=0.0), np.finfo(float).tiny)
    left, right = pairs - pairs.mean(1, keepdims=True)
    scale = np.sqrt(left @ left * (right @ right))
    return float(left @ right / scale) if scale else 0.0


def _are_counts(values: np.ndarray) -> bool:
    """Return True if ``values`` are whole numbers."""
    return bool((values == np.rint(values)).all())


def of_contact(pattern: ContactPattern, number: int) -> ContactPattern:
    """Return a copy of ``pattern`` whose mask is another contact.

    Parameters
    ----------
    pattern : ContactPattern
        Pattern of a frame.
    number : int
        Label of the contact. The mask also contains the hidden taxels that this contact encloses.
    """
    if number == 1:
        return pattern
    mask = _with_enclosed(pattern.labels == number, ~pattern.hidden)
    return pattern._replace(mask=read_only(mask))


def number_contacts(pressed: np.ndarray, hidden: np.ndarray) -> tuple[np.ndarray, int]:
    """Number the contacts of a frame by size.

    A contact is a group of 8-connected taxels. Hidden taxels connect the pressed taxels on either side of them in a row
    or column. If contacts are equally large, the first one in row-major order comes first.

    Parameters
    ----------
    pressed : np.ndarray
        Pressed taxels, bool (rows, cols).
    hidden : np.ndarray
        Taxels of the pad without a valid value, bool (rows, cols).

    Returns
    -------
    labels : np.ndarray
        Number of the contact to which each taxel belongs, uint8 (rows, cols): 1 for the largest contact, 0 for none.
    contacts : int
        Number of contacts. Contacts beyond MOST_LABELS are counted but have no label.
    """
    if not np.count_nonzero(pressed):
        return np.zeros(pressed.shape, np.uint8), 0
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
    """Return the ``hidden`` taxels that lie between two ``pressed`` taxels in a row or column.

    Only hidden taxels may lie in between.
    """
    left, right, below, above = in_line(pressed, hidden)
    return left & right | below & above


def in_line(pressed: np.ndarray, hidden: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return, for each of four directions, the hidden taxels whose nearest visible taxel is pressed.

    Parameters
    ----------
    pressed : np.ndarray
        Pressed taxels, bool (rows, cols).
    hidden : np.ndarray
        Taxels of the pad without a valid value, bool (rows, cols).

    Returns
    -------
    tuple of np.ndarray
        Four arrays, bool (rows, cols), for the directions of lower columns, higher columns, lower rows and higher rows.
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
    """Return ``mask`` together with the groups of invalid taxels that it encloses.

    Groups at the pad's edge are not enclosed.
    """
    if np.count_nonzero(valid) == valid.size:
        return mask
    labels, count = ndimage.label(np.pad(~valid, 1), EIGHT_CONNECTED)
    outside = ~np.pad(mask, 1) & (labels == 0)
    is_open = np.zeros(count + 1, bool)
    is_open[labels[ndimage.binary_dilation(outside, EIGHT_CONNECTED)]] = True
    is_open[0] = True
    return mask | ~is_open[labels[1:-1, 1:-1]]


def as_frame(values: ArrayLike) -> np.ndarray:
    """Return ``values`` as a frame, bool or float (rows, cols). The masked taxels of a masked array become NaN.

    Raises
    ------
    InputError
        Raised if ``values`` are neither real numbers nor bool, do not have two dimensions, or contain no taxel.
    """
    try:
        frame = np.ma.filled(np.ma.asarray(values, float), np.nan) if np.ma.is_masked(values) else np.asarray(values)
    except (TypeError, ValueError):
        raise _no_frame('rows of unequal length, or no numbers') from None
    if frame.ndim != 2 or not frame.size or frame.dtype.kind not in 'biuf':
        raise _no_frame(f'{frame.dtype}, shape {frame.shape}')
    return frame if frame.dtype == bool else frame.astype(float, copy=False)


def _taxels(given: ArrayLike | None, shape: tuple[int, ...], name: str) -> np.ndarray:
    """Return ``given`` as a new array. If ``given`` is None, no taxel is set in the array."""
    if given is None:
        return np.zeros(shape, bool)
    taxels = np.array(given)
    if taxels.shape != shape or taxels.dtype != bool:
        raise InputError(f'{name} taxels', expected=f'bool, shape {shape}', got=f'{taxels.dtype}, shape {taxels.shape}',
                         remedy='Pass an array with the shape of the frame, or None.')
    return taxels


def _no_frame(got: str) -> InputError:
    return InputError('taxel frame', expected='real numbers, shape (rows, cols)', got=got,
                      remedy='Pass one frame of one pad.')
