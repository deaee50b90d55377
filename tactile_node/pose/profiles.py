"""Pressure profiles under rigid objects.

The pressure is low at the centre of a flat punch and high at the centre of a dome.

Each profile is a sum of uniform pressures on nested outlines with the same centre.
"""

from enum import Enum
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.shape.recognition import Shape
from tactile_node.taxel_frame import read_only


class Indenter(str, Enum):
    """Kind of object, as inferred from its pressure."""

    FLAT_PUNCH = 'flat_punch'
    BALL = 'ball'
    CONE = 'cone'
    LYING_CYLINDER = 'lying_cylinder'


class Profile(NamedTuple):
    """Nested outlines with a uniform pressure on each. The mean of the total pressure is 1."""

    indenter: Indenter
    #: (k, 2), first and last dimension of each outline relative to the whole outline, from the outermost inwards
    sizes: np.ndarray
    weights: np.ndarray  #: (2, k), weights of a uniform pressure, and the weights that the profile adds

    #: (2,), ratio of the lengths under this profile to the lengths under an even pressure with the same moments
    length_ratio: np.ndarray


def _profile(indenter: Indenter, sizes: np.ndarray, steps: np.ndarray, length_ratio: tuple[float, float]) -> Profile:
    """Return a profile whose pressure changes by ``steps``, (k,), from one outline to the next."""
    even = np.zeros(len(steps))
    even[0] = 1
    return Profile(indenter, read_only(sizes), read_only(np.stack((even, steps - even))),
                   read_only(np.array(length_ratio)))


#: Relative sizes of a dome's outlines, which are closest together where the pressure falls.
DOME_SIZES = np.array((1.0, 0.94, 0.84, 0.68, 0.42))
#: Relative sizes of a cone's outlines, which are closest together where the pressure rises.
CONE_SIZES = np.array((1.0, 0.88, 0.70, 0.48, 0.24))
# A cylinder on its side presses harder at its ends. These values gave the closest match to contacts simulated with the
# training seeds.
END_LENGTH = 0.85    #: length between the ends, as a share of the whole length
END_PRESSURE = 0.75  #: additional pressure at the ends

# These length ratios follow from the second moments 2 / 5, 1 / 3 and 1 / 4.
BALL_LARGER = np.sqrt(5 / 4)
CONE_LARGER = np.sqrt(3 / 2)
CYLINDER_LARGER = np.sqrt(4 / 3)


def _steps(beyond: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Return the steps of the mean pressure between neighbouring outlines.

    ``beyond``, (k,), is the share of the force outside each outline, and ``area``, (k,), is the area of each outline.
    """
    force, ring = np.diff(beyond, append=1.0), -np.diff(area, append=0.0)
    return np.diff(force / ring, prepend=0.0)


def _ball() -> Profile:
    """Return the profile of a ball (Hertz): p = 1.5 sqrt(1 - r^2). The share of force beyond r is (1 - r^2)^1.5."""
    steps = _steps((1 - DOME_SIZES ** 2) ** 1.5, DOME_SIZES ** 2)
    return _profile(Indenter.BALL, np.column_stack((DOME_SIZES, DOME_SIZES)), steps, (BALL_LARGER, BALL_LARGER))


def _cone() -> Profile:
    """Return the profile of a cone (Sneddon 1948): p = arccosh(1 / r).

    The share of force beyond r is sqrt(1 - r^2) - r^2 arccosh(1 / r).
    """
    beyond = np.sqrt(1 - CONE_SIZES ** 2) - CONE_SIZES ** 2 * np.arccosh(1 / CONE_SIZES)
    return _profile(Indenter.CONE, np.column_stack((CONE_SIZES, CONE_SIZES)), _steps(beyond, CONE_SIZES ** 2),
                    (CONE_LARGER, CONE_LARGER))


def _lying_cylinder() -> Profile:
    """Return the profile of a cylinder on its side.

    Across the axis, the pressure is p = 4 / pi sqrt(1 - y^2) (Hertz). Along the axis, the ends carry more pressure,
    like the rim of a punch.
    """
    within = 2 / np.pi * (np.arcsin(DOME_SIZES) + DOME_SIZES * np.sqrt(1 - DOME_SIZES ** 2))
    across, whole = _steps(1 - within, DOME_SIZES), np.ones_like(DOME_SIZES)
    sizes = np.concatenate((np.column_stack((whole, DOME_SIZES)), np.column_stack((whole * END_LENGTH, DOME_SIZES))))
    return _profile(Indenter.LYING_CYLINDER, sizes,
                    np.concatenate((across * (1 + END_PRESSURE * END_LENGTH), across * -END_PRESSURE)),
                    (1.0, CYLINDER_LARGER))


#: Profile of a flat punch, made of two outlines. Their sizes and pressures gave the closest match to simulated contacts
#: of the five shapes with edges of any radius (synthetic/, training seeds).
PUNCH = _profile(Indenter.FLAT_PUNCH, np.array(((1.0, 1.0), (0.85, 0.85))), np.array((1.90, -1.27)),
                 (0.87, 0.87))
BALL, CONE, LYING_CYLINDER = _ball(), _cone(), _lying_cylinder()
DOMES = {Shape.CIRCLE: (BALL, CONE), Shape.RECTANGLE: (LYING_CYLINDER,)}


class Layer(NamedTuple):
    """The elastic layer of a calibrated skin."""

    depth: float      #: depth of the taxels below the skin's surface [m]
    deviation: float  #: standard deviation of the logarithm of the depth


class DepthRatio(NamedTuple):
    """Terms whose sum is the logarithm of the ratio between fitted depth and true depth."""

    large: float      #: value for an infinitely large contact
    of_size: float    #: coefficient of 1 / inscribed radius, with the radius in pitches
    deviation: float  #: standard deviation about the sum of both terms


#: A fit of a small contact underestimates the depth. The error grows as the contact gets smaller, because the two
#: nested outlines are coarser than the pressure at the rim of a punch. The values were measured on contacts simulated
#: with the training seeds, like the tables in model_error.py.
DEPTH_RATIOS = {
    Indenter.FLAT_PUNCH: DepthRatio(0.15, -1.2, 0.14),
    Indenter.BALL: DepthRatio(0.08, -0.17, 0.35),
    Indenter.CONE: DepthRatio(0.08, -0.17, 0.35),
    Indenter.LYING_CYLINDER: DepthRatio(0.18, -0.92, 0.13),
}
LEAST_RADIUS = 1.4  #: Inscribed radius below which the depth ratio was not measured [pitches].

# A depth outside these limits was probably given in another unit.
SHALLOWEST = 0.02  #: [pitches]
DEEPEST = 5.0      #: [pitches]


def expected_log_depth(layer: Layer, profile: Profile, radius: float) -> tuple[float, float]:
    """Return the expected logarithm of the depth that a fit will find, and its standard deviation.

    All lengths are in pitches.

    Parameters
    ----------
    layer : Layer
        Layer of the skin.
    profile : Profile
        Pressure profile of the object.
    radius : float
        Inscribed radius of the contact.
    """
    found = DEPTH_RATIOS[profile.indenter]
    return float(np.log(layer.depth) + _shift(found, radius)), float(np.hypot(found.deviation, layer.deviation))


def log_depth_from(found_depth: float, profile: Profile, radius: float, pitch: float) -> float:
    """Convert the depth that a fit has found to the logarithm of the true depth.

    This function is the inverse of `expected_log_depth`. For a single fit, the standard deviation is the one that
    `expected_log_depth` returns for an exactly known layer.

    Parameters
    ----------
    found_depth : float
        Depth from the fit [m].
    profile : Profile
        Pressure profile of the object.
    radius : float
        Inscribed radius of the contact [m].
    pitch : float
        Distance between neighbouring taxels [m].
    """
    return float(np.log(found_depth) - _shift(DEPTH_RATIOS[profile.indenter], radius / pitch))


def check_layer(layer: Layer, pitch: float | None = None) -> None:
    """Raise ConfigurationError if the depth or its deviation is invalid.

    If ``pitch`` [m] is given, the function also raises the error if no taxels with this pitch can have this depth.
    """
    if not (0 < layer.depth < np.inf and 0 < layer.deviation < np.inf):
        raise ConfigurationError('layer of the skin', expected='a depth > 0 [m] and a deviation > 0',
                                 got=f'depth {layer.depth!r}, deviation {layer.deviation!r}',
                                 remedy='Calibrate the skin again (tactile calibrate), or omit the layer.')
    if pitch is not None and not SHALLOWEST < layer.depth / pitch < DEEPEST:
        raise ConfigurationError('layer of the skin', got=f'{layer.depth:g} m under a pitch of {pitch:g} m',
                                 expected=f'a depth of {SHALLOWEST:g} to {DEEPEST:g} pitches',
                                 remedy='Give pitch and depth in metres.')


def _shift(found: DepthRatio, radius: float) -> float:
    return found.large + found.of_size / max(radius, LEAST_RADIUS)
