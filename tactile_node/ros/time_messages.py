"""Seconds since the Unix epoch as Time, seconds as Duration, and back."""

import math

from builtin_interfaces.msg import Duration, Time


def time_message(seconds: float) -> Time:
    """Seconds since the Unix epoch -> Time."""
    sec, nanosec = _split(seconds)
    return Time(sec=sec, nanosec=nanosec)


def duration_message(seconds: float) -> Duration:
    """Seconds -> Duration."""
    sec, nanosec = _split(seconds)
    return Duration(sec=sec, nanosec=nanosec)


def seconds(time: Time) -> float:
    """Time or Duration -> seconds."""
    return time.sec + time.nanosec * 1e-9


def _split(seconds: float) -> tuple[int, int]:
    """Seconds and nanoseconds; the parts apart, for their product with 1e9 would exceed a float's 53 bits."""
    whole = math.floor(seconds)
    nanoseconds = round((seconds - whole) * 1e9)
    return whole + nanoseconds // 10**9, nanoseconds % 10**9
