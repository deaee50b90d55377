"""Compute a first guess of pose and size from moments in closed form.

The guess uses moments up to the fourth order. The guess is exact for a completely visible shape.

A uniform triangle is an affine image of the equilateral triangle. After whitening, the third moment of the triangle
points to its corners. A side of a rectangle has the length sqrt(12 v), where v is the variance along the side. The
finite size of a taxel adds 1/12 to the variance and -1/60 to the fourth moment.
"""

from typing import NamedTuple

import numpy as np

from tactile_node.shape.recognition import Shape

WHITE_CORNERS = np.sqrt(8)  #: Distance from the centre to a corner of an equilateral triangle with variance 1.


class Guess(NamedTuple):
    """A starting point for a fit."""

    parameters: np.ndarray  #: parameters of the outline [pitches, rad]
    handedness: int = 1


class Moments(NamedTuple):
    """Moments of weighted taxels, with positions as complex numbers x + iy."""

    centre: complex
    covariance: np.ndarray
    weights: np.ndarray  #: weight of each taxel; all weights add up to 1
    offsets: np.ndarray  #: position of each taxel relative to the centre, as a complex number


def moments_of(x: np.ndarray, y: np.ndarray, weights: np.ndarray) -> Moments:
    """Return the moments of taxels at ``x`` and ``y`` with ``weights`` >= 0. At least one weight must be above 0."""
    weights, place = weights / weights.sum(), x + 1j * y
    centre = complex(weights @ place)
    offsets = place - centre
    xx, yy, xy = weights @ offsets.real**2, weights @ offsets.imag**2, weights @ (offsets.real * offsets.imag)
    least = 0.05  # even a single line of taxels has a width
    covariance = np.array(((max(xx - 1 / 12, least), xy), (xy, max(yy - 1 / 12, least))))
    return Moments(centre, covariance, weights, offsets)


def guesses(shape: Shape, moments: Moments, margin: float) -> list[Guess]:
    """Return one or more starting points for a fit, the likeliest first.

    Parameters
    ----------
    shape : Shape
        Shape of the outline.
    moments : Moments
        Moments of the contact.
    margin : float
        A corner of a triangle also yields a starting point if its misfit exceeds the best corner's misfit by at most
        this margin. For a right triangle, the misfit is an angle [rad]. For an isosceles triangle, the misfit is the
        logarithm of a ratio of lengths.
    """
    x, y = moments.centre.real, moments.centre.imag
    if shape is Shape.CIRCLE:
        return [Guess(np.array((x, y, np.sqrt(2 * np.trace(moments.covariance)))))]
    if shape is Shape.SQUARE:
        fourth = moments.weights @ moments.offsets**4 + 1 / 60
        return [Guess(np.array((x, y, np.angle(-fourth) / 4, np.sqrt(6 * np.trace(moments.covariance)))))]
    if shape is Shape.RECTANGLE:
        variance, axes = np.linalg.eigh(moments.covariance)
        short, long = np.sqrt(12 * np.maximum(variance, 0.02))
        return [Guess(np.array((x, y, np.arctan2(axes[1, 1], axes[0, 1]), long, short)))]
    corners = _triangle(moments)
    return (_right if shape is Shape.RIGHT_TRIANGLE else _isosceles)(corners, margin)


def _triangle(moments: Moments) -> np.ndarray:
    """Return the corners of the triangle with these moments, as complex numbers ordered by rotation from x to y."""
    variance, axes = np.linalg.eigh(moments.covariance)
    scale = np.sqrt(np.maximum(variance, 0.02))
    if np.linalg.det(axes) < 0:
        axes = axes * (1, -1)
    places = np.stack((moments.offsets.real, moments.offsets.imag), 1) @ axes / scale
    white = places @ (1, 1j)
    angle = (np.angle(moments.weights @ white**3) + 2 * np.pi * np.arange(3)) / 3
    corners = WHITE_CORNERS * np.column_stack((np.cos(angle), np.sin(angle))) * scale @ axes.T
    return corners @ (1, 1j) + moments.centre


def _right(corners: np.ndarray, margin: float) -> list[Guess]:
    following, preceding = np.roll(corners, -1) - corners, np.roll(corners, 1) - corners
    centre, found = corners.mean(), []
    for i in _best(np.abs(np.abs(np.angle(preceding / following)) - np.pi / 2), margin):
        handedness = 1 if abs(following[i]) >= abs(preceding[i]) else -1
        long, short = (following[i], preceding[i]) if handedness > 0 else (preceding[i], following[i])
        found.append(Guess(np.array((centre.real, centre.imag, np.angle(long), abs(long), abs(short))), handedness))
    return found


def _isosceles(corners: np.ndarray, margin: float) -> list[Guess]:
    following, preceding = np.roll(corners, -1) - corners, np.roll(corners, 1) - corners
    centre, found = corners.mean(), []
    for apex in _best(np.abs(np.log(np.abs(following) / np.abs(preceding))), margin):
        up, base = corners[apex] - centre, abs(corners[(apex + 2) % 3] - corners[(apex + 1) % 3])
        found.append(Guess(np.array((centre.real, centre.imag, np.angle(up) - np.pi / 2, base, 1.5 * abs(up)))))
    return found


def _best(misfit: np.ndarray, margin: float) -> list[int]:
    order = np.argsort(misfit)
    return [int(i) for i in order if misfit[i] <= misfit[order[0]] + margin]
