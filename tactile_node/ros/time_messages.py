"""Convert seconds since the Unix epoch to Time and back, and seconds to Duration and back."""

import math

from builtin_interfaces.msg import Duration, Time


def time_message(seconds: float) -> Time:
    """Convert seconds since the Unix epoch to a Time message."""
    sec, nanosec = _split(seconds)
    return Time(sec=sec, nanosec=nanosec)


def duration_message(seconds: float) -> Duration:
    """Convert seconds to a Duration message."""
    sec, nanosec = _split(seconds)
    return Duration(sec=sec, nanosec=nanosec)


def seconds(time: Time) -> float:
    """Convert a Time or Duration message to seconds."""
    return time.sec + time.nanosec * 1e-9


def _split(seconds: float) -> tuple[int, int]:
    """Return whole seconds and nanoseconds separately, because a float with 53 bits cannot hold both."""
    whole = math.floor(seconds)
    nanoseconds = round((seconds - whole) * 1e9)
    return whole + nanoseconds // 10**9, nanoseconds % 10**9
