"""What each taxel's counts amount to: one mark a taxel, for a map."""

from enum import IntEnum

import numpy as np

from tactile_node.conditioning.taxel_faults import TaxelFault
from tactile_node.frames.taxel_frame import TaxelStatus
from tactile_node.report.model import TaxelHealth


class Mark(IntEnum):
    """The worst that is known of a taxel; a later one prevails."""

    GOOD = 0           #: had a value in every frame, which changed
    NEVER_CHANGED = 1  #: an untouched taxel of a quiet skin does not either
    SATURATED = 2      #: at the end of its range in some frames
    SOME_MISSING = 3   #: without a value in some frames
    NO_VALUE = 4       #: without a value in every frame
    FLICKERING = 5
    STUCK = 6          #: also at the end of its range
    DEAD = 7           #: by what it sent, by the layout or the driver
    UNMAPPED = 8       #: no place of a taxel


def no_value_share(health: TaxelHealth) -> np.ndarray:
    """Return, for each taxel, the share of frames without a value; NaN where there is no taxel. (rows, cols)."""
    valued = health.by_status[[TaxelStatus.VALID, TaxelStatus.SATURATED]].sum(0)
    share: np.ndarray = 1 - valued / max(1, health.frames)
    return np.where(health.by_status[TaxelStatus.UNMAPPED] == health.frames, np.nan, share)


def marks_of(health: TaxelHealth) -> np.ndarray:
    """Return the Mark of each taxel, uint8, (rows, cols)."""
    missing, faults, counts = no_value_share(health), health.faults, health.by_status
    marks = np.zeros(missing.shape, np.uint8)
    for mark, places in (
            (Mark.NEVER_CHANGED, health.never_changed),
            (Mark.SATURATED, counts[TaxelStatus.SATURATED] > 0),
            (Mark.SOME_MISSING, missing > 0),
            (Mark.NO_VALUE, missing == 1),
            (Mark.FLICKERING, faults == TaxelFault.FLICKERING),
            (Mark.STUCK, (faults == TaxelFault.STUCK) | (faults == TaxelFault.SATURATED)
             | (counts[TaxelStatus.FAULTY] > 0)),
            (Mark.DEAD, (faults == TaxelFault.DEAD) | (counts[TaxelStatus.DEAD] > 0)),
            (Mark.UNMAPPED, np.isnan(missing))):
        marks[places] = mark
    return marks
