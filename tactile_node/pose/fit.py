"""Find the pose and size of a contact of known shape by a least-squares fit of its outline to the taxel values."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np

from tactile_node.contact.neighbours import touches_edge
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.contact.visibility import Visibility, visibility_of
from tactile_node.pose.candidate import loading_of
from tactile_node.pose.evidence import Evidence, checked, gather
from tactile_node.pose.least_squares import in_blocks, size_of
from tactile_node.pose.moments import check_pitch
from tactile_node.pose.outlines import OUTLINES, outline_of, rotation
from tactile_node.pose.profiles import Indenter, Layer, check_layer
from tactile_node.pose.rim import Rim, is_cut, reach, rim_of
from tactile_node.pose.search import Found, follow, search
from tactile_node.shape.recognition import Shape, ShapeClass, TaughtShape
from tactile_node.taxel_frame import read_only

SEARCH_PERIOD = 0.5   #: Interval at which the outline of a lasting contact is searched for again [s].
SEARCH_GROWTH = 1.25  #: Growth factor of the evidence after which the outline is searched for again.


class ShapeFit(NamedTuple):
    """Pose and size of a contact in the pad frame, in metres.

    The pad frame has its origin at taxel (0, 0). The x coordinate grows with the column, and the y coordinate with the
    row.
    """

    shape: Shape
    centre: tuple[float, float]  #: centre of area [m]
    angle: float                 #: direction of the shape's own x axis, positive from x to y [rad]; 0 for a circle

    #: The shape looks the same after a rotation by 2π/symmetry. A symmetry of 0 means that the shape looks the same
    #: after any rotation. An isosceles triangle has symmetry 3 if the taxels cannot distinguish it from an equilateral
    #: triangle, so that any corner may be the apex.
    symmetry: int
    handedness: int                   #: 1 or -1 (mirrored) for a right triangle, 0 for other shapes
    dimension_names: tuple[str, ...]  #: names of the dimensions, as in `outlines.OUTLINES`
    dimensions: tuple[float, ...]     #: length of each dimension [m]

    #: for each dimension, True if the value is only the visible length, because the contact may continue unseen
    #: (`fit_contact`)
    is_bound: tuple[bool, ...]
    covariance: np.ndarray  #: covariance of the parameters in ``parameter_names`` [m, rad]
    residual: float  #: root mean square of the difference between value and model, as a fraction of the contact's level
    outline: np.ndarray  #: corners, (n, 2), ordered by rotation from x to y [m]
    indenter: Indenter | None  #: kind of object, as inferred from its pressure; None for on/off taxels
    peak: float  #: 0 for an even pressure, about 1 for the pressure of a punch or a dome, NaN for on/off taxels
    depth: float  #: fitted depth of the taxels below the skin's surface [m]; NaN for on/off taxels

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters in ``covariance``: x, y, the angle (except for a circle) and the dimensions."""
        return OUTLINES[self.shape].parameters

    @property
    def parameters(self) -> np.ndarray:
        """Values of the parameters in ``parameter_names``."""
        return np.array((*self.centre, *((self.angle,) if self.symmetry else ()), *self.dimensions))


class Part(NamedTuple):
    """The part of a frame to which an outline is fitted.

    A wide contact is divided into blocks of several taxels.
    """

    evidence: Evidence
    size: int = 1   #: side length of a block [taxels]
    x: float = 0.0  #: column at the centre of block (0, 0) [taxels]
    y: float = 0.0  #: row at the centre of block (0, 0) [taxels]


#: Function that finds the outline of a shape in a part of a frame. The layer's lengths are in units of one block.
Finder: TypeAlias = Callable[[Part, Shape, Layer | None], Found]


def fit_shape(values: np.ndarray, mask: np.ndarray, shape: ShapeClass, pitch: float = 1.0,
              layer: Layer | None = None, find: Finder | None = None) -> ShapeFit | None:
    """Fit the outline of a shape to a contact.

    A wide contact is divided into blocks of taxels before the fit.

    Parameters
    ----------
    values : np.ndarray
        Taxel values, (rows, cols), in any unit that grows with pressure, with NaN for an invalid value. Booleans are an
        on/off pattern.
    mask : np.ndarray
        Taxels of the contact, bool (rows, cols).
    shape : ShapeClass
        Shape to fit.
    pitch : float
        Distance between neighbouring taxels [m].
    layer : Layer or None
        Layer of a calibrated skin, or None if the layer is unknown.
    find : Finder or None
        Finder of a `FitFollower`, or None to search in this frame alone.

    Returns
    -------
    ShapeFit or None
        The fit, or None if the shape has no outline.

    Raises
    ------
    InputError
        Raised if the arrays have different shapes or are not real numbers, or if the mask is empty.
    ConfigurationError
        Raised if the pitch or the layer is invalid.

    Examples
    --------
    >>> fit = fit_shape(np.pad(np.ones((4, 4)), 3), np.pad(np.ones((4, 4), bool), 3), Shape.SQUARE)
    >>> [round(length, 1) for length in (*fit.centre, *fit.dimensions)]
    [4.5, 4.5, 4.0]
    """
    check_pitch(pitch)
    if layer is not None:
        check_layer(layer, pitch)
    if isinstance(shape, TaughtShape) or shape not in OUTLINES:
        return None
    part = _part(*checked(values, mask))
    in_pitches = layer._replace(depth=layer.depth / (pitch * part.size)) if layer else None
    found = find(part, Shape(shape), in_pitches) if find else search(part.evidence, Shape(shape), in_pitches)
    return in_metres(found, part, pitch)


def _part(values: np.ndarray, mask: np.ndarray) -> Part:
    size = size_of(mask)
    blocks = in_blocks(values, mask, size) if size > 1 else None
    if blocks is None or not blocks.mask.any():  # a single line of taxels never fills half of a block
        return Part(gather(values, mask))
    return Part(gather(blocks.values, blocks.mask, touches_edge(mask)), size, blocks.x, blocks.y)


class FitFollower:
    """Fits a contact from frame to frame, starting from the outline in the previous frame.

    Following an outline takes a quarter of the time that a search takes. The follower searches again in these cases:

    - in the first frame,
    - every SEARCH_PERIOD, because a dome or another corner may have become more likely,
    - if following the outline leads to a worse fit,
    - if the evidence has grown by SEARCH_GROWTH. A contact under light pressure, or seen only in part, may look like a
      dome, whose outline is larger.
    """

    def __init__(self) -> None:
        # outline, with the part of the frame and the stamp of its last search
        self._before: dict[Shape, tuple[Found, Part, float]] = {}

    def restart(self) -> None:
        """Start a new search in the next frame, because a new contact begins."""
        self._before.clear()

    def at(self, stamp: float) -> Finder:
        """Return the finder for the next frame, which was acquired at ``stamp`` [s]."""
        return partial(self._find, stamp)

    def _find(self, stamp: float, part: Part, shape: Shape, layer: Layer | None) -> Found:
        found = None
        if shape in self._before:
            before, its_part, searched = self._before[shape]
            is_clearer = part.evidence.strength > SEARCH_GROWTH * its_part.evidence.strength
            if its_part[1:] == part[1:] and 0 <= stamp - searched < SEARCH_PERIOD and not is_clearer:
                found = follow(part.evidence, before)
        if found is None:
            found, its_part, searched = search(part.evidence, shape, layer), part, stamp
        self._before[shape] = found, its_part, searched
        return found


def in_metres(found: Found, part: Part, pitch: float) -> ShapeFit:
    """Convert an outline found in one part of a frame to a fit in the pad frame.

    Parameters
    ----------
    found : Found
        Outline in the part, with lengths in units of one block.
    part : Part
        The fitted part of the frame.
    pitch : float
        Distance between neighbouring taxels [m].
    """
    shape, estimate, pitch = found.shape, found.estimate, pitch * part.size
    outline = outline_of(shape, estimate.handedness)
    scale = np.array([1.0 if name == 'angle' else pitch for name in outline.parameters])
    origin = np.array((part.x, part.y)) / part.size
    corners = (outline.corners(estimate.parameters) + origin) * pitch
    covariance = estimate.covariance * (scale * scale[:, np.newaxis])
    corners.flags.writeable = covariance.flags.writeable = False
    centre, angle, dimensions = outline.split(estimate.parameters * scale)
    handedness = estimate.handedness if shape is Shape.RIGHT_TRIANGLE else 0
    loading = loading_of(found.candidate)
    return ShapeFit(shape=shape, centre=tuple((centre + origin * pitch).tolist()), angle=angle,
                    symmetry=estimate.symmetry, handedness=handedness, dimension_names=outline.dimensions,
                    dimensions=tuple(dimensions.tolist()), is_bound=(False,) * len(dimensions), covariance=covariance,
                    residual=found.residual, outline=corners,
                    indenter=loading.indenter if loading else None, peak=loading.peak if loading else np.nan,
                    depth=loading.depth * pitch if loading else np.nan)


#: Shapes with axes that run from one side to the opposite side, so that a length can be a bound. A triangle is
#: completed instead, and its standard deviations show the uncertainty.
UPRIGHT_SHAPES = (Shape.CIRCLE, Shape.SQUARE, Shape.RECTANGLE)


def fit_contact(pattern: ContactPattern, shape: ShapeClass, pitch: float = 1.0, layer: Layer | None = None,
                visibility: Visibility | None = None, find: Finder | None = None) -> ShapeFit | None:
    """Fit a shape to the contact of a pattern, as `fit_shape` does, and mark the lengths that are only bounds.

    If part of a circle, a square or a rectangle is unseen, the fit contains the visible length and marks it as a bound.
    A triangle is completed, and its standard deviations show how certain the result is.

    Parameters
    ----------
    pattern : ContactPattern
        Pattern of the frame.
    shape : ShapeClass
        Shape to fit.
    pitch : float
        Distance between neighbouring taxels [m].
    layer : Layer or None
        Layer of a calibrated skin, or None if the layer is unknown.
    visibility : Visibility or None
        Visibility of the pattern, or None to compute it from the pattern.
    find : Finder or None
        Finder of a `FitFollower`, or None to search in this frame alone.
    """
    taxels = pattern.mask if are_on_off(pattern.values) else pattern.values
    fit = fit_shape(taxels, pattern.mask, shape, pitch, layer, find)
    if fit is None or fit.shape not in UPRIGHT_SHAPES:
        return fit
    visibility = visibility or visibility_of(pattern)
    is_whole = not (visibility.at_edge or visibility.outline_hidden)
    return fit if is_whole else _bounded(fit, rim_of(pattern, visibility), pitch)


def _bounded(fit: ShapeFit, rim: Rim, pitch: float) -> ShapeFit:
    is_bound = is_cut(rim, fit.angle)
    if fit.shape is not Shape.RECTANGLE:
        is_bound[:] = is_bound.any()
    if not is_bound.any():
        return fit
    axes = rotation(fit.angle)
    per_dimension = 2.0 if fit.shape is Shape.CIRCLE else 1.0
    middle, half = axes @ fit.centre, per_dimension * np.resize(fit.dimensions, 2) / 2
    ends = reach(rim, np.array([fit.angle]))[..., 0] * pitch
    low, high = np.maximum(middle - half, ends[:, 0]), np.minimum(middle + half, ends[:, 1])
    seen = np.where(is_bound, high - low, 2 * half)
    dimensions = (seen if fit.shape is Shape.RECTANGLE else seen.max(keepdims=True)) / per_dimension
    centre = np.where(is_bound, (low + high) / 2, middle) @ axes
    return fit._replace(
        centre=tuple(centre.tolist()), dimensions=tuple(dimensions.tolist()),
        is_bound=tuple(is_bound.tolist()[:len(dimensions)]),
        outline=read_only(OUTLINES[fit.shape].placed(centre, fit.angle, dimensions)))
