"""Small conversions that every message needs."""

from array import array

import numpy as np
from builtin_interfaces.msg import Duration, Time


def time_message(seconds: float) -> Time:
    """Seconds since the Unix epoch -> Time."""
    nanoseconds = round(seconds * 1e9)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def duration_message(seconds: float) -> Duration:
    """Seconds -> Duration."""
    nanoseconds = round(seconds * 1e9)
    return Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def seconds(time: Time) -> float:
    """Time or Duration -> seconds."""
    return time.sec + time.nanosec * 1e-9


def as_array(code: str, values: np.ndarray, dtype: type) -> array:
    """As array.array: rclpy checks any other sequence element by element."""
    return array(code, np.ascontiguousarray(values, dtype).tobytes())
