"""Define a taxel frame, which holds all taxels of one pad from one sweep of a live bus or a log.

The module also defines the thresholds at which a taxel counts as pressed.
"""

import math
from enum import IntEnum, IntFlag
from typing import NamedTuple

import numpy as np

PRESS_BY_UNIT = {'Pa': 30e3, 'N': 0.1, '1': 0.5}  #: Fixed press thresholds: 30 kPa, 0.1 N and "on".
RELEASE_RATIO = 0.8  #: Release threshold as a share of the press threshold.
ON_OFF_UNIT = '1'
#: No taxel below this value counts as pressed, even on a very quiet skin, because drift between two tares may reach
#: this value.
LEAST_BY_UNIT = {'Pa': 2e3, 'N': 0.007}


def read_only(array: np.ndarray) -> np.ndarray:
    """Return the array itself, made read-only, so that no stage can change the result of another stage."""
    array.setflags(write=False)
    return array


class TaxelStatus(IntEnum):
    """Status of a taxel: whether its value is valid, and if not, why. TaxelArray.msg uses the same numbers."""

    NOT_KNOWN = 0  #: default in a message; the taxel has no value
    VALID = 1
    STALE = 2      #: the taxel's CAN frame did not arrive in this SYNC period
    UNMAPPED = 3   #: the skin layout maps no TPDO field to this taxel
    DEAD = 4       #: known to be dead, either from the layout file or from the taxel's values
    SATURATED = 5  #: at the end of its range; the value is given, but is only a lower bound
    FAULTY = 6     #: stuck or flickering, according to the taxel's values


class SkinSide(IntFlag):
    """A set of sides of a pad. TaxelArray.msg uses the same numbers."""

    FIRST_ROW = 1
    LAST_ROW = 2
    FIRST_COL = 4
    LAST_COL = 8


NO_SIDE = SkinSide(0)


class TpdoAges(NamedTuple):
    """Age of each TPDO's values, for a frame whose TPDOs were not sampled together. Arrays are read-only."""

    ages: np.ndarray         #: float32 (TPDOs,), age at the stamp of the frame, counted from reception, >= 0 [s]
    taxel_tpdos: np.ndarray  #: uint16 (rows, cols), index of the TPDO that contains each taxel; 0 for an UNMAPPED taxel

    def of(self, row: int, col: int) -> float:
        """Return the age of a taxel's value [s]."""
        return float(self.ages[self.taxel_tpdos[row, col]])


class TaxelFrame(NamedTuple):
    """All taxels of one pad in one SYNC period. Without SYNC, the values come from one sweep or from the latest TPDOs.

    The array ``values`` has the shape (rows, cols). Row 0 and column 0 are at the origin of the pad's frame, and the
    values are in the layout's SI unit. The array is read-only. A value is NaN (never 0) if ``status`` reports no valid
    value.
    """

    #: Acquisition time [s, Unix epoch]. With SYNC, it is the time at which the SYNC of this period was on the bus.
    #: Without SYNC, it is the time of the first TPDO of this sweep or, with ``tpdo_ages``, of the newest TPDO in the
    #: frame.
    stamp: float
    sequence: int  #: number of SYNC periods since the driver became active; a gap means lost frames
    values: np.ndarray  #: float32, shape (rows, cols)
    status: np.ndarray  #: uint8 TaxelStatus, shape (rows, cols)
    missing_can_frames: int  #: number of TPDOs of this period whose values are missing from the frame
    tpdo_ages: TpdoAges | None = None  #: None if all values come from one sweep
    #: the moment of ``stamp`` on the steady clock [s], which the router adds; -inf if not known
    acquired: float = -math.inf

    @property
    def has_value(self) -> np.ndarray:
        """True for each taxel with a value, bool (rows, cols)."""
        return np.isin(self.status, (TaxelStatus.VALID, TaxelStatus.SATURATED))

    def without(self, taxels: np.ndarray, status: np.ndarray | int = TaxelStatus.STALE) -> 'TaxelFrame':
        """Return the frame without the values of some taxels.

        Parameters
        ----------
        taxels : np.ndarray
            True for each taxel whose value becomes NaN, bool (rows, cols).
        status : np.ndarray or int
            New `TaxelStatus` of these taxels: one for all, or (rows, cols).
        """
        return self._replace(values=read_only(np.where(taxels, np.float32(np.nan), self.values)),
                             status=read_only(np.where(taxels, np.asarray(status, np.uint8), self.status)))
