"""The distance of neighbouring taxels, as fits and moments take it."""

import numpy as np

from tactile_node.errors import ConfigurationError


def check_pitch(pitch: float) -> None:
    """Raise ConfigurationError unless ``pitch`` is a length > 0, finite."""
    try:
        is_length = bool(0 < pitch < np.inf)
    except (TypeError, ValueError):  # no number
        is_length = False
    if not is_length:
        raise ConfigurationError('pitch', expected='a length > 0 in metres', got=repr(pitch),
                                 remedy='Give the distance of neighbouring taxel centres.')
