"""A TaxelArray of a bag -> its taxel frame and the pad's geometry; the rules are those of `ros/message_checks.py`."""

import math
from typing import NamedTuple, Protocol

import numpy as np

from tactile_node.frames.taxel_frame import TaxelFrame, TaxelStatus, TpdoAges
from tactile_node.press_levels import PRESS_BY_UNIT
from tactile_node.read_only import read_only
from tactile_node.skin.layout import MAX_SIDE

NANOSECONDS = 10**9
GIVES_VALUE = TaxelStatus.VALID, TaxelStatus.SATURATED


class PadGeometry(NamedTuple):
    """What a TaxelArray says of its pad."""

    rows: int
    cols: int
    pitch: float  #: [m]
    unit: str     #: 'Pa', 'N' or '1'
    frame_id: str
    layer_depth: float = 0.0      #: of the taxels below the skin's surface [m]; 0: not known
    layer_deviation: float = 0.0  #: standard deviation of its logarithm


class Stamp(Protocol):
    """builtin_interfaces/Time."""

    sec: int
    nanosec: int


def seconds(stamp: Stamp) -> float:
    return stamp.sec + stamp.nanosec / NANOSECONDS


def geometry_of(message) -> PadGeometry:
    """Of a TaxelArray that has passed `fault_of`; fields that the bag's definition lacks are not known."""
    return PadGeometry(message.rows, message.cols, float(message.pitch), message.unit, message.header.frame_id,
                       float(getattr(message, 'layer_depth', 0.0)), float(getattr(message, 'layer_deviation', 0.0)))


def frame_of(message) -> TaxelFrame:
    """Of a TaxelArray that has passed `fault_of`."""
    grid = message.rows, message.cols
    ages = None
    if len(getattr(message, 'tpdo_ages', ())):
        ages = TpdoAges(_array(message.tpdo_ages, np.float32), _array(message.taxel_tpdos, np.uint16).reshape(grid))
    return TaxelFrame(stamp=seconds(message.header.stamp), sequence=message.sequence,
                      values=_array(message.values, np.float32).reshape(grid),
                      status=_array(message.status, np.uint8).reshape(grid),
                      missing_can_frames=message.missing_can_frames, tpdo_ages=ages)


def fault_of(message) -> str:
    """Return what of a TaxelArray does not fit together; '' where all does: any program can write into a bag."""
    taxels = message.rows * message.cols
    if not taxels or max(message.rows, message.cols) > MAX_SIDE:
        return 'rows, cols'
    if len(message.values) != taxels or len(message.status) != taxels:
        return 'length of values, status'
    if message.unit not in PRESS_BY_UNIT:
        return 'unit'
    if not 0 < message.pitch < math.inf:
        return 'pitch'
    status = np.asarray(message.status, np.uint8)
    if status.max() > max(TaxelStatus) or (np.isin(status, GIVES_VALUE) != np.isfinite(message.values)).any():
        return 'status'
    if message.header.stamp.sec < 0 or message.header.stamp.nanosec >= NANOSECONDS:
        return 'stamp'
    return _fault_of_ages(message, taxels)


def _fault_of_ages(message, taxels: int) -> str:
    ages, indices = getattr(message, 'tpdo_ages', ()), getattr(message, 'taxel_tpdos', ())
    if not len(ages) and not len(indices):
        return ''
    is_whole = len(ages) and len(indices) == taxels and max(indices) < len(ages)
    return '' if is_whole and (np.isfinite(ages) & (np.asarray(ages) >= 0)).all() else 'tpdo_ages, taxel_tpdos'


def _array(values, dtype: type) -> np.ndarray:
    return read_only(np.array(values, dtype))
