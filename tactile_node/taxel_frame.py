"""A taxel frame: all taxels of one pad of one sweep, from a live bus or a log; from which reading on one is pressed."""

from enum import IntEnum, IntFlag
from typing import NamedTuple

import numpy as np

#: Absolute thresholds: a taxel is pressed from here on: 30 kPa, 0.1 N, on.
PRESS_BY_UNIT = {'Pa': 30e3, 'N': 0.1, '1': 0.5}
RELEASE_RATIO = 0.8  #: share of the press threshold
ON_OFF_UNIT = '1'
#: Below this no taxel is pressed, however quiet the skin is: drift between two tares may reach it.
LEAST_BY_UNIT = {'Pa': 2e3, 'N': 0.007}


def read_only(array: np.ndarray) -> np.ndarray:
    """The array itself, no longer writeable: no stage may change what another one made."""
    array.flags.writeable = False
    return array


class TaxelStatus(IntEnum):
    """Why a taxel has, or has not, a valid value (TaxelArray.msg mirrors these numbers)."""

    NOT_KNOWN = 0  #: the default of a message; no value
    VALID = 1
    STALE = 2      #: its CAN frame did not arrive in this SYNC period
    UNMAPPED = 3   #: the skin layout maps no TPDO field to it
    DEAD = 4       #: known to be dead, by the layout file or by what it sent
    SATURATED = 5  #: at the end of its range: the value is a lower bound, still given
    FAULTY = 6     #: stuck or flickering, by what it sent


class SkinSide(IntFlag):
    """A set of sides of a pad (TaxelArray.msg mirrors these numbers)."""

    FIRST_ROW = 1
    LAST_ROW = 2
    FIRST_COL = 4
    LAST_COL = 8


NO_SIDE = SkinSide(0)


class TpdoAges(NamedTuple):
    """How old the values of each TPDO are, in a frame whose TPDOs were not sampled together. Arrays are read-only."""

    ages: np.ndarray  #: float32, shape (TPDOs,): at the frame's stamp, from their reception, >= 0 [s]
    taxel_tpdos: np.ndarray  #: uint16, shape (rows, cols): whose value each taxel has; 0 where UNMAPPED

    def of(self, row: int, col: int) -> float:
        """The age of a taxel's value [s]."""
        return float(self.ages[self.taxel_tpdos[row, col]])


class TaxelFrame(NamedTuple):
    """All taxels of one pad in one SYNC period; without SYNC, of one sweep or the latest of each TPDO.

    ``values`` has shape (rows, cols), row 0 and column 0 at the pad frame's origin, in the layout's SI
    unit. It is read-only, and NaN (never 0) where ``status`` reports no valid value.
    """

    #: acquisition time [s, Unix epoch]: when the SYNC of this period was on the bus; without SYNC, the first TPDO of
    #: this sweep, or the newest TPDO in it (``tpdo_ages``)
    stamp: float
    sequence: int  #: counts SYNC periods since the driver became active, gaps are lost frames
    values: np.ndarray  #: float32, shape (rows, cols)
    status: np.ndarray  #: uint8 TaxelStatus, shape (rows, cols)
    missing_can_frames: int  #: TPDOs of this period that did not arrive, or not as mapped
    tpdo_ages: TpdoAges | None = None  #: None: all values are of one sweep


def without_any_value(frame: TaxelFrame) -> TaxelFrame:
    """NaN and STALE in place of every value."""
    given = np.isin(frame.status, (TaxelStatus.VALID, TaxelStatus.SATURATED))
    return frame._replace(values=read_only(np.full_like(frame.values, np.nan)),
                          status=read_only(np.where(given, np.uint8(TaxelStatus.STALE), frame.status)))
