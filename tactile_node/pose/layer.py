"""What is known of a skin's layer before a contact is fitted: how deep its taxels are."""

from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.pose.profiles import Indenter, Profile


class Layer(NamedTuple):
    """Of a calibrated skin."""

    depth: float      #: of the taxels below the skin's surface [m]
    deviation: float  #: standard deviation of its logarithm


class Expected(NamedTuple):
    """What a fit finds for the logarithm of the depth, beforehand."""

    mean: float
    deviation: float


class _Found(NamedTuple):
    """Logarithm of the depth that fits find over the true one."""

    large: float      #: of contacts without end
    of_size: float    #: added, per 1 / inscribed radius [pitches]
    deviation: float  #: standard deviation about that


#: A fit makes the depth too small, the more so the smaller the contact: its two nested outlines are coarser than the
#: pressure at a punch's rim. Found on computed contacts of training seeds (as model_error.py's tables).
_FOUND = {Indenter.FLAT_PUNCH: _Found(0.15, -1.2, 0.14), Indenter.BALL: _Found(0.08, -0.17, 0.35),
          Indenter.CONE: _Found(0.08, -0.17, 0.35), Indenter.LYING_CYLINDER: _Found(0.18, -0.92, 0.13)}
LEAST_RADIUS = 1.4  #: [pitches]: not known below
SHALLOWEST, DEEPEST = 0.02, 5.0  #: [pitches]: beyond, lengths are in other units


def expected_log_depth(layer: Layer, profile: Profile, radius: float) -> Expected:
    """Return what a fit of a contact of inscribed ``radius`` will find; it and the layer in units of pitches."""
    found = _FOUND[profile.indenter]
    return Expected(float(np.log(layer.depth) + _shift(found, radius)),
                    float(np.hypot(found.deviation, layer.deviation)))


def log_depth_from(found_depth: float, profile: Profile, radius: float, pitch: float) -> float:
    """Return the logarithm of the true depth, given what one fit has found: the inverse of `expected_log_depth`.

    Lengths in metres. One fit knows it to the deviation of `expected_log_depth` of an exact layer.
    """
    return float(np.log(found_depth) - _shift(_FOUND[profile.indenter], radius / pitch))


def check_layer(layer: Layer, pitch: float | None = None) -> None:
    """Raise ConfigurationError for what is no depth, or none of taxels with this ``pitch`` [m]."""
    if not (0 < layer.depth < np.inf and 0 < layer.deviation < np.inf):
        raise ConfigurationError('layer of the skin', expected='a depth > 0 [m] and a deviation > 0',
                                 got=f'depth {layer.depth!r}, deviation {layer.deviation!r}',
                                 remedy='Calibrate the skin again (tactile calibrate), or leave the layer out.')
    if pitch is not None and not SHALLOWEST < layer.depth / pitch < DEEPEST:
        raise ConfigurationError('layer of the skin', got=f'{layer.depth:g} m under a pitch of {pitch:g} m',
                                 expected=f'a depth of {SHALLOWEST:g} to {DEEPEST:g} pitches',
                                 remedy='Give pitch and depth in metres.')


def _shift(found: _Found, radius: float) -> float:
    return found.large + found.of_size / max(radius, LEAST_RADIUS)
