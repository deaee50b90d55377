"""Taxel frames as messages, and back."""

from array import array

import numpy as np

from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.pose.layer import Layer
from tactile_node.ros.time_messages import time_message
from tactile_skin.msg import Contact, TaxelArray


def taxel_array_message(frame: TaxelFrame, pitch: float, unit: str, frame_id: str,
                        layer: Layer | None = None) -> TaxelArray:
    """``pitch`` [m], ``unit``, ``frame_id`` and ``layer``, if it is known, are the pad's."""
    message = TaxelArray(
        sequence=frame.sequence, rows=frame.values.shape[0], cols=frame.values.shape[1], pitch=pitch, unit=unit,
        values=as_array('f', frame.values, np.float32), status=as_array('B', frame.status, np.uint8),
        missing_can_frames=frame.missing_can_frames)
    message.header.stamp = time_message(frame.stamp)
    message.header.frame_id = frame_id
    if layer is not None:
        message.layer_depth, message.layer_deviation = layer
    if frame.tpdo_ages is not None:
        message.tpdo_ages = as_array('f', frame.tpdo_ages.ages, np.float32)
        message.taxel_tpdos = as_array('H', frame.tpdo_ages.taxel_tpdos, np.uint16)
    return message


def taxel_values(message: TaxelArray | Contact) -> np.ndarray:
    """Return the values of a TaxelArray or Contact, float32, shape (rows, cols), NaN = no valid value."""
    return np.frombuffer(message.values, np.float32).reshape(message.rows, message.cols)


def as_array(code: str, values: np.ndarray, dtype: type) -> array:
    """Return ``values`` as array.array, row by row: rclpy checks any other sequence element by element."""
    return array(code, np.ascontiguousarray(values, dtype).tobytes())
