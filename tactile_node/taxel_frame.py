"""A taxel frame: all taxels of one pad from one sweep, from a live bus or a log.

The module also holds the thresholds from which on a taxel is pressed.
"""

from enum import IntEnum, IntFlag
from typing import NamedTuple

import numpy as np

PRESS_BY_UNIT = {'Pa': 30e3, 'N': 0.1, '1': 0.5}  #: Fixed press thresholds: 30 kPa, 0.1 N, on.
RELEASE_RATIO = 0.8  #: Release threshold as a share of the press threshold.
ON_OFF_UNIT = '1'
#: Below this value no taxel is pressed, however quiet the skin is, because drift between two tares may reach it.
LEAST_BY_UNIT = {'Pa': 2e3, 'N': 0.007}


def read_only(array: np.ndarray) -> np.ndarray:
    """Return the array itself, made read-only, so that no stage can change the result of another stage."""
    array.flags.writeable = False
    return array


class TaxelStatus(IntEnum):
    """Reason why a taxel has a valid value, or has none (TaxelArray.msg mirrors these numbers)."""

    NOT_KNOWN = 0  #: the default in a message; the taxel has no value
    VALID = 1
    STALE = 2      #: the taxel's CAN frame did not arrive in this SYNC period
    UNMAPPED = 3   #: the skin layout maps no TPDO field to this place
    DEAD = 4       #: known to be dead from the layout file or from its values
    SATURATED = 5  #: at the end of its range; the value is a lower bound but is still given
    FAULTY = 6     #: stuck or flickering according to its values


class SkinSide(IntFlag):
    """A set of sides of a pad (TaxelArray.msg mirrors these numbers)."""

    FIRST_ROW = 1
    LAST_ROW = 2
    FIRST_COL = 4
    LAST_COL = 8


NO_SIDE = SkinSide(0)


class TpdoAges(NamedTuple):
    """Ages of the values of each TPDO, in a frame whose TPDOs were not sampled together. Arrays are read-only."""

    ages: np.ndarray         #: float32 (TPDOs,), age at the frame's stamp, counted from reception, >= 0 [s]
    taxel_tpdos: np.ndarray  #: uint16 (rows, cols), index of the TPDO that holds each taxel; 0 where UNMAPPED

    def of(self, row: int, col: int) -> float:
        """Return the age of a taxel's value [s]."""
        return float(self.ages[self.taxel_tpdos[row, col]])


class TaxelFrame(NamedTuple):
    """All taxels of one pad in one SYNC period; without SYNC, from one sweep or from the latest TPDOs.

    ``values`` has the shape (rows, cols), with row 0 and column 0 at the origin of the pad's frame, in the layout's SI
    unit. The array is read-only. A value is NaN (never 0) if ``status`` reports no valid value.
    """

    #: Acquisition time [s, Unix epoch]: the time at which the SYNC of this period was on the bus. Without SYNC, the
    #: time of the first TPDO of this sweep, or of the newest TPDO in the frame (``tpdo_ages``).
    stamp: float
    sequence: int  #: number of SYNC periods since the driver became active; gaps are lost frames
    values: np.ndarray  #: float32, shape (rows, cols)
    status: np.ndarray  #: uint8 TaxelStatus, shape (rows, cols)
    missing_can_frames: int  #: number of TPDOs of this period that did not arrive, or did not arrive as mapped
    tpdo_ages: TpdoAges | None = None  #: None if all values come from one sweep


def without_any_value(frame: TaxelFrame) -> TaxelFrame:
    """Return the frame with NaN and STALE in place of every value."""
    given = np.isin(frame.status, (TaxelStatus.VALID, TaxelStatus.SATURATED))
    return frame._replace(values=read_only(np.full_like(frame.values, np.nan)),
                          status=read_only(np.where(given, np.uint8(TaxelStatus.STALE), frame.status)))
