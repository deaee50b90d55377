"""Pressure under rigid objects: low in the middle of a flat punch, high in the middle of a dome.

As a sum of uniform pressures on outlines within each other, about the same centre.
"""

from enum import Enum
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.shape.recognition import Shape
from tactile_node.taxel_frame import read_only


class Indenter(str, Enum):
    """What presses, as far as its pressure shows."""

    FLAT_PUNCH = 'flat_punch'
    BALL = 'ball'
    CONE = 'cone'
    LYING_CYLINDER = 'lying_cylinder'


class Profile(NamedTuple):
    """Outlines and the pressures on them; their sum has a mean of 1."""

    indenter: Indenter
    sizes: np.ndarray    #: (k, 2), of the outline's first and last dimension, relative, from the whole outline inwards
    weights: np.ndarray  #: (2, k): of a uniform pressure, and of what the profile's differs from it
    length_ratio: np.ndarray  #: (2,), lengths under it over those of an even pressure of the same moments


def _profile(indenter: Indenter, sizes: np.ndarray, steps: np.ndarray, length_ratio: tuple[float, float]) -> Profile:
    """``steps``, (k,): of the pressure from one outline to the next."""
    even = np.zeros(len(steps))
    even[0] = 1
    return Profile(indenter, read_only(sizes), read_only(np.stack((even, steps - even))),
                   read_only(np.array(length_ratio)))


#: of a dome's outlines: more of them where its pressure falls
DOME_SIZES = np.array((1.0, 0.94, 0.84, 0.68, 0.42))
#: a cylinder's pressure at its ends: the closest to computed ones of training seeds
END_LENGTH, END_PRESSURE = 0.85, 0.75
#: of a cone's: more of them where its pressure rises
CONE_SIZES = np.array((1.0, 0.88, 0.70, 0.48, 0.24))
#: of the second moments 2 / 5, 1 / 3 and 1 / 4
BALL_LARGER, CONE_LARGER, CYLINDER_LARGER = np.sqrt(5 / 4), np.sqrt(3 / 2), np.sqrt(4 / 3)


def _steps(beyond: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Return steps of the mean pressure between neighbours, by force ``beyond`` each outline and ``area``, (k,)."""
    force, ring = np.diff(beyond, append=1.0), -np.diff(area, append=0.0)
    return np.diff(force / ring, prepend=0.0)


def _ball() -> Profile:
    """Hertz: p = 1.5 sqrt(1 - r^2); beyond r is a share (1 - r^2)^1.5 of the force."""
    steps = _steps((1 - DOME_SIZES ** 2) ** 1.5, DOME_SIZES ** 2)
    return _profile(Indenter.BALL, np.column_stack((DOME_SIZES, DOME_SIZES)), steps, (BALL_LARGER, BALL_LARGER))


def _cone() -> Profile:
    """Sneddon (1948): p = arccosh(1 / r); beyond r is a share sqrt(1 - r^2) - r^2 arccosh(1 / r) of the force."""
    beyond = np.sqrt(1 - CONE_SIZES ** 2) - CONE_SIZES ** 2 * np.arccosh(1 / CONE_SIZES)
    return _profile(Indenter.CONE, np.column_stack((CONE_SIZES, CONE_SIZES)), _steps(beyond, CONE_SIZES ** 2),
                    (CONE_LARGER, CONE_LARGER))


def _lying_cylinder() -> Profile:
    """Hertz across the axis: p = 4 / pi sqrt(1 - y^2). Along it the ends carry more, as a punch's rim does."""
    within = 2 / np.pi * (np.arcsin(DOME_SIZES) + DOME_SIZES * np.sqrt(1 - DOME_SIZES ** 2))
    across, whole = _steps(1 - within, DOME_SIZES), np.ones_like(DOME_SIZES)
    sizes = np.concatenate((np.column_stack((whole, DOME_SIZES)), np.column_stack((whole * END_LENGTH, DOME_SIZES))))
    return _profile(Indenter.LYING_CYLINDER, sizes,
                    np.concatenate((across * (1 + END_PRESSURE * END_LENGTH), across * -END_PRESSURE)),
                    (1.0, CYLINDER_LARGER))


#: Two outlines whose sizes and pressures are the closest to what contact mechanics computes for the five shapes with
#: edges of any rounding (synthetic/, training seeds).
PUNCH = _profile(Indenter.FLAT_PUNCH, np.array(((1.0, 1.0), (0.85, 0.85))), np.array((1.90, -1.27)),
                 (0.87, 0.87))
BALL, CONE, LYING_CYLINDER = _ball(), _cone(), _lying_cylinder()
DOMES = {Shape.CIRCLE: (BALL, CONE), Shape.RECTANGLE: (LYING_CYLINDER,)}


class Layer(NamedTuple):
    """Layer of a calibrated skin."""

    depth: float      #: depth of the taxels below the skin's surface [m]
    deviation: float  #: standard deviation of its logarithm


class _Found(NamedTuple):
    """Logarithm of the depth that fits find over the true one."""

    large: float      #: shift of contacts without end
    of_size: float    #: added, per 1 / inscribed radius [pitches]
    deviation: float  #: standard deviation about that


#: A fit makes the depth too small, the more so the smaller the contact: its two nested outlines are coarser than the
#: pressure at a punch's rim. Found on computed contacts of training seeds (as model_error.py's tables).
_FOUND = {Indenter.FLAT_PUNCH: _Found(0.15, -1.2, 0.14), Indenter.BALL: _Found(0.08, -0.17, 0.35),
          Indenter.CONE: _Found(0.08, -0.17, 0.35), Indenter.LYING_CYLINDER: _Found(0.18, -0.92, 0.13)}
LEAST_RADIUS = 1.4  #: [pitches]: not known below
SHALLOWEST, DEEPEST = 0.02, 5.0  #: [pitches]: beyond, lengths are in other units


def expected_log_depth(layer: Layer, profile: Profile, radius: float) -> tuple[float, float]:
    """Return what a fit of a contact of inscribed ``radius`` will find, and its standard deviation; all in pitches."""
    found = _FOUND[profile.indenter]
    return float(np.log(layer.depth) + _shift(found, radius)), float(np.hypot(found.deviation, layer.deviation))


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
