"""Finds faulty taxels by what they send: dead, stuck, flickering, saturated; and keeps them in a file."""

from collections.abc import Mapping
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from scipy.ndimage import label, maximum_filter

from tactile_node.errors import ConfigurationError, InputError
from tactile_node.output_file import output_file
from tactile_node.taxel_frame import read_only
from tactile_node.yaml_section import load_mapping

CONTACTS = 5          #: that must give evidence against a taxel, one after the other
MIN_TOUCHED = 3       #: taxels that make a contact
FALLEN_SHARE = 0.6    #: share of the taxels that rose in a contact have fallen when it is over
RELEASED_SHARE = 0.5  #: share of the taxels pressed at its height that may still be: edges come and go in a grasp
APART = 3.0           #: taxels by which the centres of these contacts must differ, for a dead taxel
ALIVE = 0.1           #: x limit: a taxel that reads so much has felt something
SIDE_DIRECTIONS = ((0, 1), (1, 0), (1, 1), (1, -1))
JUMP_SHARE = 2.0            #: x limit: a change from one frame to the next that counts as a jump
ALONE_SHARE = 0.5           #: x limit: a jump is alone when no neighbour changes by so much in the same frame
FLICKER_TIME = 5.0    #: s over which lone jumps are counted
FLICKER_JUMPS = 40    #: lone jumps within that time, and
FLICKER_SHARE = 0.25  #: share of the frames within it


class TaxelFault(IntEnum):
    """What is wrong with a taxel; the numbers are stable."""

    NONE = 0
    DEAD = 1        #: silent while what surrounds it is pressed, in contact after contact
    STUCK = 2       #: pressed, and does not move by one count, while contacts around it come and go
    FLICKERING = 3  #: jumps up and down by itself
    SATURATED = 4   #: stuck at the end of its range


class FaultyTaxels(NamedTuple):
    """The faulty taxels of a pad."""

    kinds: np.ndarray  #: uint8 TaxelFault, (rows, cols), read-only

    def places(self, kind: TaxelFault) -> list[tuple[int, int]]:
        """(row, col) of all that are ``kind``, row by row."""
        return [(int(row), int(col)) for row, col in np.argwhere(self.kinds == kind)]

    @property
    def total(self) -> int:
        """How many taxels are faulty."""
        return int(np.count_nonzero(self.kinds))


class FaultDetector:
    """Detects the faulty taxels of one pad, frame by frame. ``limit``: less counts as not pressed, in the taxels' unit.

    Evidence is counted by *contacts*: MIN_TOUCHED taxels rise over ``limit``, nearly all of them fall again, and then
    not many are left pressed (where more are stuck than any contact presses, none is found).
    Time alone proves nothing: an untouched pad has no dead taxels, a grasp of an hour no stuck ones.

    - Dead: in CONTACTS contacts that are APART (what a ring leaves out in one place it presses in another), not ALIVE
      though pressed taxels lay next to it on both sides, in two of four directions: more of a hole than two taxels
      lacks them. Taxels in the corners of a pad have no two sides and are never found so, nor are blocks of dead ones.
    - Stuck: pressed at the end of CONTACTS contacts and the same to the bit since before the first of them, alone or
      with fewer neighbours of its like than make a contact (an object still held presses more). One at the end of its
      range is saturated.
    - Flickering: FLICKER_JUMPS jumps within FLICKER_TIME, in FLICKER_SHARE of the frames, in which no neighbour took
      part or was pressed or unknown; faulty neighbours do not count. Of two side by side none is found.

    One sign of life clears the fault.
    """

    def __init__(self, rows: int, cols: int, limit: float):
        shape = (rows, cols)
        self.limit = limit  #: may be changed at any time
        self._last = np.full(shape, np.nan)
        self._pressed, self._risen = np.zeros((2, *shape), bool)
        self._height = 0  # taxels pressed at most in this contact
        self._still = np.zeros(shape, int)   # contacts since the value last changed
        self._silent = np.zeros(shape, int)  # contacts around it that it did not feel
        self._range = np.zeros((2, 2, *shape))  # centres of these contacts: least and greatest row, column
        self._jumps, self._stamp = np.zeros(shape), -np.inf
        self._is_saturated = np.zeros(shape, bool)
        self._frames = 0.0
        self._unknown = np.ones(shape, bool)  # in the last frame
        self.has_changed = False              # in the last frame
        self.faults = FaultyTaxels(read_only(np.zeros(shape, np.uint8)))

    def update(self, stamp: float, values: np.ndarray, zero: np.ndarray | float,
               is_saturated: np.ndarray) -> FaultyTaxels:
        """Evaluate a frame of ``values`` (rows, cols) as sent, NaN: unknown, measured at ``stamp`` [s].

        ``zero`` is what the taxels read without load.
        """
        known = np.isfinite(values)
        values = np.where(known, values, self._last)
        change = np.abs(values - self._last)
        moved = change > 0  # False where a value is the first
        self.has_changed = bool(moved.any())
        self._is_saturated = np.where(known, is_saturated, self._is_saturated)
        is_news = self._count_jumps(stamp, change, ~known | self._unknown)
        self._unknown = ~known
        self._last, was_pressed = values, self._pressed
        self._pressed = values - zero >= self.limit
        self._silent[moved & (values - zero >= ALIVE * self.limit)] = 0
        if moved.any():
            self._still[moved] = 0
            self._risen |= self._pressed & ~was_pressed & moved
            is_news |= bool((self.faults.kinds[moved] != 0).any())
        if self._is_contact_over():
            self._count_contact()
            is_news = True
        if is_news:
            self.faults = FaultyTaxels(read_only(self._evaluate()))
        return self.faults

    def _count_jumps(self, stamp: float, change: np.ndarray, unknown: np.ndarray) -> bool:
        """Count jumps that no neighbour takes part in; True when a fault may appear or clear."""
        passed, self._stamp = stamp - self._stamp, stamp
        was_flickering, fading = self._is_flickering(), np.exp(-max(passed, 0.0) / FLICKER_TIME)
        self._jumps *= fading
        self._frames = self._frames * fading + 1
        jumps = change >= JUMP_SHARE * self.limit
        if jumps.any():
            others = np.where(unknown | self._pressed, np.inf, np.nan_to_num(change))
            others[self.faults.kinds != 0] = 0
            others = maximum_filter(others, footprint=NEIGHBOURS, mode='constant')
            self._jumps[jumps & (others < ALONE_SHARE * self.limit)] += 1
        return bool((was_flickering != self._is_flickering()).any())

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
        """Find stuck taxels: what was stuck stays so while it does not move, and is no neighbour to others."""
        still = pressed & (self._still >= CONTACTS)
        before = still & np.isin(self.faults.kinds, (TaxelFault.STUCK, TaxelFault.SATURATED))
        groups, count = label(pressed & ~before, structure=np.ones((3, 3)))
        sizes = np.bincount(groups.ravel(), minlength=count + 1)
        moving = np.bincount(groups.ravel(), weights=~still.ravel(), minlength=count + 1)
        return before | still & ((sizes < MIN_TOUCHED) & (moving == 0))[groups]


NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)


def _find_surrounded(mask: np.ndarray) -> np.ndarray:
    """Where ``mask`` holds next to it on both sides, in two directions; on an edge, along it."""
    rows, cols = mask.shape
    padded = np.pad(mask, 1)

    def at(down: int, right: int) -> np.ndarray:
        return padded[1 + down:1 + down + rows, 1 + right:1 + right + cols]
    both = np.array([at(down, right) & at(-down, -right) for down, right in SIDE_DIRECTIONS])
    found = both.sum(0) >= 2
    found[[0, -1], :] |= both[0][[0, -1], :]
    found[:, [0, -1]] |= both[1][:, [0, -1]]
    return found


FILE_CONTENT = 'a file of faulty taxels'
FILE_HEAD = '''# Faulty taxels, [row, col], as the skin driver found them. They are NaN from the first frame on.
# Remove one to have it evaluated again; add one that you know to be faulty.
'''
FAULT_KINDS = tuple(kind for kind in TaxelFault if kind)


def load_faults(path: str | Path, pads: Mapping[str, tuple[int, int]]) -> dict[str, FaultyTaxels]:
    """Read the faulty taxels of ``pads`` (name -> rows, cols). No file, or a pad not in it: none.

    Raises ConfigurationError naming file and key for anything else that is wrong.
    """
    kinds, path = {name: np.zeros(shape, np.uint8) for name, shape in pads.items()}, _usable(path)
    if path.exists():
        top = load_mapping(path, FILE_CONTENT)
        section = top.section('pads')
        for name, (rows, cols) in pads.items():
            given = section.section(name, {})
            for kind in FAULT_KINDS:
                key = kind.name.lower()
                for taxel in given.sequence(key, []):
                    row, col = given.checked_integers(key, taxel, count=2, low=0, high=max(rows, cols) - 1)
                    if row >= rows or col >= cols:
                        given.refuse(key, expected=f'taxels of {rows} rows and {cols} columns', got=f'[{row}, {col}]',
                                     remedy='Correct or remove it.')
                    kinds[name][row, col] = kind
            given.done()
        top.done()
    return {name: FaultyTaxels(read_only(array)) for name, array in kinds.items()}


def save_faults(path: str | Path, faults: Mapping[str, FaultyTaxels]) -> None:
    """Write the faulty taxels of these pads; entries of other pads stay. Raises ConfigurationError."""
    path = _usable(path)
    pads = load_mapping(path, FILE_CONTENT).take('pads', {}) if path.exists() else {}
    if not isinstance(pads, dict):
        raise ConfigurationError(str(path), expected=FILE_CONTENT, got='another one', remedy='Name another file.')
    pads |= {name: {kind.name.lower(): [list(place) for place in found.places(kind)] for kind in FAULT_KINDS}
             for name, found in faults.items()}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with output_file(path) as stream:
            content = yaml.safe_dump({'pads': pads}, default_flow_style=None, sort_keys=False)
            stream.write((FILE_HEAD + content).encode())
    except (OSError, InputError) as error:
        got = error.got if isinstance(error, InputError) else error.strerror or str(error)
        raise ConfigurationError(str(path), expected='a file that can be written', got=got,
                                 remedy='Set faulty_taxels_file to another path.') from error


def _usable(path: str | Path) -> Path:
    """``~`` expanded. Raises ConfigurationError for a path that the system cannot even look for."""
    try:
        expanded = Path(path).expanduser()
        expanded.exists()
        return expanded
    except (OSError, RuntimeError, ValueError) as error:
        raise ConfigurationError(f'parameter faulty_taxels_file, {str(path)[:80]!r}', expected='a path',
                                 got=str(error)[:200], remedy='Set it to another path.') from error
