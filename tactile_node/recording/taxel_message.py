"""A TaxelArray of a bag -> its taxel frame and the pad's geometry; its rules are in `skin/taxel_array.py`."""

from typing import NamedTuple, Protocol

import numpy as np

from tactile_node.frames.taxel_frame import TaxelFrame, TpdoAges
from tactile_node.read_only import read_only

NANOSECONDS = 10**9


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
    """Of a TaxelArray that has passed `check_taxel_array`; fields that the bag's definition lacks are not known."""
    return PadGeometry(message.rows, message.cols, float(message.pitch), message.unit, message.header.frame_id,
                       float(getattr(message, 'layer_depth', 0.0)), float(getattr(message, 'layer_deviation', 0.0)))


def frame_of(message) -> TaxelFrame:
    """Of a TaxelArray that has passed `check_taxel_array`."""
    grid = message.rows, message.cols
    ages = None
    if len(getattr(message, 'tpdo_ages', ())):
        ages = TpdoAges(_array(message.tpdo_ages, np.float32), _array(message.taxel_tpdos, np.uint16).reshape(grid))
    return TaxelFrame(stamp=seconds(message.header.stamp), sequence=message.sequence,
                      values=_array(message.values, np.float32).reshape(grid),
                      status=_array(message.status, np.uint8).reshape(grid),
                      missing_can_frames=message.missing_can_frames, tpdo_ages=ages)


def _array(values, dtype: type) -> np.ndarray:
    return read_only(np.array(values, dtype))
