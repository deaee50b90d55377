"""Find the pose and size of a contact of known shape by a least-squares fit of its outline to the taxel values."""

from typing import NamedTuple

import numpy as np

from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.contact.visibility import Visibility, visibility_of
from tactile_node.pose.evidence import gather
from tactile_node.pose.moments import check_pitch
from tactile_node.pose.outline_fit import OutlineFit
from tactile_node.pose.outlines import OUTLINES, outline_of, rotation
from tactile_node.pose.profiles import Indenter, Layer, check_layer
from tactile_node.pose.rim import Rim, is_cut, reach, rim_of
from tactile_node.shape.recognition import Shape, ShapeClass, TaughtShape
from tactile_node.taxel_frame import read_only

#: Shapes with axes that run from one side to the opposite side, so that a length can be a bound. A triangle is
#: completed instead, and its standard deviations show the uncertainty.
UPRIGHT_SHAPES = (Shape.CIRCLE, Shape.SQUARE, Shape.RECTANGLE)


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
    indenter: Indenter | None  #: kind of object, as inferred from its pressure; None for on/off taxels
    peak: float  #: 0 for an even pressure, about 1 for the pressure of a punch or a dome, NaN for on/off taxels
    depth: float  #: fitted depth of the taxels below the skin's surface [m]; NaN for on/off taxels

    @property
    def outline(self) -> np.ndarray:
        """Corners, (n, 2), ordered by rotation from x to y [m]."""
        return outline_of(self.shape, self.handedness).placed(np.array(self.centre), self.angle,
                                                              np.array(self.dimensions))

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters in ``covariance``: x, y, the angle (except for a circle) and the dimensions."""
        return OUTLINES[self.shape].parameters

    @property
    def parameters(self) -> np.ndarray:
        """Values of the parameters in ``parameter_names``."""
        return np.array((*self.centre, *((self.angle,) if self.symmetry else ()), *self.dimensions))

    @classmethod
    def of(cls, found: OutlineFit, pitch: float) -> 'ShapeFit':
        """Convert the results of an outline fit to metres.

        Parameters
        ----------
        found : OutlineFit
            The fit, with lengths in blocks of its evidence.
        pitch : float
            Distance between neighbouring taxels [m].
        """
        shape, evidence, loading, outline = found.shape, found.best.evidence, found.best.loading, OUTLINES[found.shape]
        pitch *= evidence.size
        scale = np.array([1.0 if name == 'angle' else pitch for name in outline.parameters])
        origin = np.array((evidence.x, evidence.y)) / evidence.size
        centre, angle, dimensions = outline.split(found.parameters * scale)
        return cls(shape=shape, centre=tuple((centre + origin * pitch).tolist()), angle=angle,
                   symmetry=found.symmetry, handedness=found.handedness if shape is Shape.RIGHT_TRIANGLE else 0,
                   dimension_names=outline.dimensions, dimensions=tuple(dimensions.tolist()),
                   is_bound=(False,) * len(dimensions),
                   covariance=read_only(found.covariance * (scale * scale[:, np.newaxis])),
                   residual=found.residual,
                   indenter=loading.indenter if loading else None, peak=loading.peak if loading else np.nan,
                   depth=loading.depth * pitch if loading else np.nan)

    @property
    def pose_covariance(self) -> np.ndarray:
        """Covariance of the pose, (6, 6), in the order of geometry_msgs/PoseWithCovariance.

        The order is x, y, z, then the rotations about x, y and z. The contact lies in the pad's plane, so the variances
        of z and of the rotations about x and y are 0. The angle of a circle is undefined, so its variance is π²/3, as
        for a uniform distribution.
        """
        covariance = np.zeros((6, 6))
        kept = [0, 1, 5] if self.symmetry else [0, 1]
        covariance[np.ix_(kept, kept)] = self.covariance[:len(kept), :len(kept)]
        if not self.symmetry:
            covariance[5, 5] = np.pi**2 / 3
        return covariance

    def solid(self, height: float) -> tuple[str, tuple[float, ...]] | None:
        """Return the primitive that stands on the contact, or None for a triangle (use `prism`).

        Parameters
        ----------
        height : float
            Height of the primitive [m].

        Returns
        -------
        tuple or None
            'box' with (x, y, z), or 'cylinder' with (height, radius), in the frame of the fit's pose. The lengths are
            in the order of shape_msgs/SolidPrimitive [m].
        """
        if self.shape is Shape.CIRCLE:
            return 'cylinder', (height, self.dimensions[0])
        if self.shape in (Shape.SQUARE, Shape.RECTANGLE):
            return 'box', (self.dimensions[0], self.dimensions[-1], height)
        return None

    def prism(self, height: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the vertices and triangles of a closed mesh that stands on the contact.

        Parameters
        ----------
        height : float
            Height of the mesh [m].

        Returns
        -------
        vertices : np.ndarray
            Coordinates of the vertices in the pad frame, (2n, 3) [m], with z from 0 to ``height``.
        triangles : np.ndarray
            Indices of the vertices of each triangle, (4n - 4, 3), counter-clockwise as seen from outside.
        """
        count = len(self.outline)
        base = np.column_stack((self.outline, np.zeros(count)))
        fan = np.array([(0, i, i + 1) for i in range(1, count - 1)])
        i = np.arange(count)
        j = (i + 1) % count
        sides = np.concatenate((np.column_stack((i, j, j + count)), np.column_stack((i, j + count, i + count))))
        return np.concatenate((base, base + (0, 0, height))), np.concatenate((fan[:, ::-1], fan + count, sides))


def fit_shape(values: np.ndarray, mask: np.ndarray, shape: ShapeClass, pitch: float = 1.0,
              layer: Layer | None = None, outlines: dict[Shape, OutlineFit] | None = None,
              stamp: float = 0.0) -> ShapeFit | None:
    """Fit the outline of a shape to a contact.

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
    outlines : dict[Shape, OutlineFit] or None
        Fits to earlier frames of the contact, which the function continues and extends, or None to search in this frame
        alone.
    stamp : float
        Acquisition time of the frame [s], used only with ``outlines``.

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
    evidence = gather(values, mask)
    if layer is not None:
        layer = layer._replace(depth=layer.depth / (pitch * evidence.size))
    outlines, shape = {} if outlines is None else outlines, Shape(shape)
    outline = outlines.setdefault(shape, OutlineFit(shape))
    outline.estimate(evidence, layer, stamp)
    return ShapeFit.of(outline, pitch)


def fit_contact(pattern: ContactPattern, shape: ShapeClass, pitch: float = 1.0, layer: Layer | None = None,
                visibility: Visibility | None = None, outlines: dict[Shape, OutlineFit] | None = None,
                stamp: float = 0.0) -> ShapeFit | None:
    """Fit a shape to the contact of a pattern, as `fit_shape` does, and mark the lengths that are only bounds.

    If part of a circle, a square or a rectangle is unseen, the fit contains the visible length and marks it as a bound.
    A triangle is completed, and its standard deviations show how certain the result is.

    Parameters
    ----------
    pattern : ContactPattern
        Pattern of the frame.
    visibility : Visibility or None
        Visibility of the pattern, or None to compute it from the pattern.
    shape, pitch, layer, outlines, stamp
        As for `fit_shape`.
    """
    taxels = pattern.mask if are_on_off(pattern.values) else pattern.values
    fit = fit_shape(taxels, pattern.mask, shape, pitch, layer, outlines, stamp)
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
        is_bound=tuple(is_bound.tolist()[:len(dimensions)]))
