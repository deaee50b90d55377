"""Find faulty taxels (dead, stuck, flickering, saturated) from their values."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from scipy.ndimage import label, maximum_filter

from tactile_node.taxel_frame import read_only

CONTACTS = 5        #: Number of successive contacts that must provide evidence against a taxel.
MIN_TOUCHED = 3     #: Smallest number of taxels in a contact.
FALLEN_SHARE = 0.6  #: A contact is over when at least this share of the taxels that rose in it have fallen again.

#: A contact is over when at most this share of the taxels pressed at its height are still pressed. The share is not
#: higher because edges come and go during a grasp.
RELEASED_SHARE = 0.5
APART = 3.0  #: Smallest distance between the centres of the contacts that prove that a taxel is dead [taxels].
ALIVE = 0.1  #: A taxel that reads at least this share of the limit counts as alive.
SIDE_DIRECTIONS = ((0, 1), (1, 0), (1, 1), (1, -1))
JUMP_SHARE = 2.0      #: A change from one frame to the next by at least this multiple of the limit is a jump.

#: A jump is a lone jump if no neighbour changes by this share of the limit in the same frame.
ALONE_SHARE = 0.5
FLICKER_TIME = 5.0    #: Time over which lone jumps are counted [s].
FLICKER_JUMPS = 40    #: Number of lone jumps within FLICKER_TIME that make a taxel flickering.
FLICKER_SHARE = 0.25  #: Share of the frames within FLICKER_TIME in which a flickering taxel jumps.


class TaxelFault(IntEnum):
    """Fault of a taxel. The code numbers never change."""

    NONE = 0
    DEAD = 1        #: silent in several contacts that pressed the surrounding taxels
    STUCK = 2       #: pressed with exactly the same value while contacts around it come and go
    FLICKERING = 3  #: jumps up and down while its neighbours do not
    SATURATED = 4   #: stuck at the end of its range


class FaultyTaxels(NamedTuple):
    """The faulty taxels of a pad."""

    kinds: np.ndarray  #: uint8 TaxelFault, (rows, cols), read-only

    def places(self, kind: TaxelFault) -> list[tuple[int, int]]:
        """Return the (row, col) of all taxels with this fault, row by row."""
        return [(int(row), int(col)) for row, col in np.argwhere(self.kinds == kind)]

    @property
    def total(self) -> int:
        """Number of faulty taxels."""
        return int(np.count_nonzero(self.kinds))


class FaultDetector:
    """Detects the faulty taxels of one pad, frame by frame.

    The detector counts evidence by contacts, because time alone proves nothing: an untouched pad shows no dead taxels,
    and an hour's grasp shows no stuck taxels. A contact is counted once MIN_TOUCHED taxels have risen above ``limit``,
    nearly all of them have fallen again, and only few taxels remain pressed. The detector finds no faults if more
    taxels are stuck than any contact presses.

    - A taxel is *dead* if it was not ALIVE in CONTACTS contacts, although pressed taxels lay on both sides of it in two
      of four directions. The centres of these contacts must be APART. If a ring is pressed at several such places, it
      also presses the taxels that lay in its hole before. A taxel in the corner of a pad lies between no other taxels,
      so it is never found dead. Blocks of dead taxels are not found either, because a hole of more than two taxels
      contains taxels without pressed taxels on both sides.

    - A taxel is *stuck* if it was pressed at the end of CONTACTS contacts, and its value has been bit-identical since
      before the first of these contacts. A stuck taxel must be alone or have fewer stuck neighbours than a contact has
      taxels, because an object that is still held presses more taxels. A stuck taxel at the end of its range is
      *saturated*.

    - A taxel is *flickering* if it made FLICKER_JUMPS jumps within FLICKER_TIME, and jumped in FLICKER_SHARE of the
      frames. A jump counts if no neighbour took part in it, was pressed or had no value. Faulty neighbours are ignored.
      Two flickering taxels side by side are not found.

    A single sign of life clears a fault.

    Parameters
    ----------
    rows, cols : int
        Number of rows and columns of the pad.
    limit : float
        Reading above the zero at which a taxel counts as pressed, in the taxels' unit.
    """

    def __init__(self, rows: int, cols: int, limit: float):
        shape = (rows, cols)
        self.limit = limit  #: press limit, which may change at any time
        self._last = np.full(shape, np.nan)
        self._pressed, self._risen = np.zeros((2, *shape), bool)
        self._height = 0  # largest number of taxels pressed during this contact
        self._still = np.zeros(shape, int)   # number of contacts since the taxel's value last changed
        self._silent = np.zeros(shape, int)  # number of contacts around the taxel that the taxel did not feel
        self._range = np.zeros((2, 2, *shape))  # smallest and largest row and column of the centres of these contacts
        self._jumps, self._stamp = np.zeros(shape), -np.inf
        self._is_saturated = np.zeros(shape, bool)
        self._frames = 0.0
        self._unknown = np.ones(shape, bool)  # taxels without a value in the last frame
        self.has_changed = False              # True if any taxel changed in the last frame
        self.faults = FaultyTaxels(read_only(np.zeros(shape, np.uint8)))

    def update(self, stamp: float, values: np.ndarray, zero: np.ndarray | float,
               is_saturated: np.ndarray) -> FaultyTaxels:
        """Return the faulty taxels after one more frame.

        Parameters
        ----------
        stamp : float
            Time at which the frame was acquired [s].
        values : np.ndarray
            Taxel values as sent, (rows, cols); NaN if unknown.
        zero : np.ndarray or float
            Readings of the unloaded taxels.
        is_saturated : np.ndarray
            Taxels at the end of their range, bool (rows, cols).
        """
        known = np.isfinite(values)
        values = np.where(known, values, self._last)
        change = np.abs(values - self._last)
        moved = change > 0  # False for the first value of a taxel
        self.has_changed = bool(np.count_nonzero(moved))
        self._is_saturated = np.where(known, is_saturated, self._is_saturated)
        is_news = self._count_jumps(stamp, change, ~known | self._unknown)
        self._unknown = ~known
        self._last, was_pressed = values, self._pressed
        load = values - zero
        self._pressed = load >= self.limit
        if self.has_changed:
            self._silent[moved & (load >= ALIVE * self.limit)] = 0
            self._still[moved] = 0
            self._risen |= self._pressed & ~was_pressed & moved
            is_news |= bool(np.count_nonzero(self.faults.kinds[moved]))
        if self._is_contact_over():
            self._count_contact()
            is_news = True
        if is_news:
            self.faults = FaultyTaxels(read_only(self._evaluate()))
        return self.faults

    def _count_jumps(self, stamp: float, change: np.ndarray, unknown: np.ndarray) -> bool:
        """Count the jumps in which no neighbour took part. Return True if a fault may have appeared or cleared."""
        passed, self._stamp = stamp - self._stamp, stamp
        was_flickering, fading = self._is_flickering(), np.exp(-max(passed, 0.0) / FLICKER_TIME)
        self._jumps *= fading
        self._frames = self._frames * fading + 1
        jumps = change >= JUMP_SHARE * self.limit
        if np.count_nonzero(jumps):
            others = np.where(unknown | self._pressed, np.inf, np.nan_to_num(change))
            others[self.faults.kinds != 0] = 0
            others = maximum_filter(others, footprint=NEIGHBOURS, mode='constant')
            self._jumps[jumps & (others < ALONE_SHARE * self.limit)] += 1
        return bool(np.count_nonzero(was_flickering != self._is_flickering()))

    def _is_flickering(self) -> np.ndarray:
        return self._jumps >= max(FLICKER_JUMPS, FLICKER_SHARE * self._frames)

    def _is_contact_over(self) -> bool:
        risen, pressed = int(np.count_nonzero(self._risen)), int(np.count_nonzero(self._pressed))
        self._height = max(self._height, pressed)
        fallen = np.count_nonzero(self._risen & ~self._pressed)
        return bool(risen >= MIN_TOUCHED and pressed <= RELEASED_SHARE * self._height
                    and fallen >= FALLEN_SHARE * risen)

    def _count_contact(self) -> None:
        touched, self._risen, self._height = self._risen, np.zeros_like(self._risen), 0
        self._still += 1
        surrounded = _find_surrounded(touched) & ~touched & ~self._pressed
        places = np.argwhere(touched)
        centre = places.mean(0)[:, np.newaxis, np.newaxis]
        least, greatest = self._range
        is_first = surrounded & (self._silent == 0)
        least[:, is_first] = np.inf
        greatest[:, is_first] = -np.inf
        np.minimum(least, centre, out=least, where=surrounded)
        np.maximum(greatest, centre, out=greatest, where=surrounded)
        self._silent[surrounded] += 1

    def _evaluate(self) -> np.ndarray:
        kinds = np.zeros(self._last.shape, np.uint8)
        apart = np.hypot(*(self._range[1] - self._range[0])) >= APART
        kinds[(self._silent >= CONTACTS) & apart] = TaxelFault.DEAD
        flickering = self._is_flickering()
        stuck = self._stuck(self._pressed & ~flickering)
        kinds[stuck] = TaxelFault.STUCK
        kinds[stuck & self._is_saturated] = TaxelFault.SATURATED
        kinds[flickering] = TaxelFault.FLICKERING
        return kinds

    def _stuck(self, pressed: np.ndarray) -> np.ndarray:
        """Return the stuck taxels.

        A taxel remains stuck while its value does not change. Stuck taxels do not count as neighbours of other taxels.
        """
        still = pressed & (self._still >= CONTACTS)
        before = still & np.isin(self.faults.kinds, (TaxelFault.STUCK, TaxelFault.SATURATED))
        groups, count = label(pressed & ~before, structure=np.ones((3, 3)))
        sizes = np.bincount(groups.ravel(), minlength=count + 1)
        moving = np.bincount(groups.ravel(), weights=~still.ravel(), minlength=count + 1)
        return before | still & ((sizes < MIN_TOUCHED) & (moving == 0))[groups]


NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)


def _find_surrounded(mask: np.ndarray) -> np.ndarray:
    """Return the taxels that lie between taxels of ``mask`` in two directions.

    At an edge, one direction along the edge suffices.
    """
    rows, cols = mask.shape
    padded = np.pad(mask, 1)

    def at(down: int, right: int) -> np.ndarray:
        return padded[1 + down:1 + down + rows, 1 + right:1 + right + cols]
    both = np.array([at(down, right) & at(-down, -right) for down, right in SIDE_DIRECTIONS])
    found = both.sum(0) >= 2
    found[[0, -1], :] |= both[0][[0, -1], :]
    found[:, [0, -1]] |= both[1][:, [0, -1]]
    return found
