"""A shape fitted to a contact, with the lengths whose ends are not seen as bounds."""

import numpy as np

from tactile_node.contact.on_off import are_on_off
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.visibility import Visibility, visibility_of
from tactile_node.geometry.outlines import OUTLINES
from tactile_node.pose.fit import ShapeFit, fit_shape
from tactile_node.pose.layer import Layer
from tactile_node.pose.rim import Rim, is_cut, reach, rim_of
from tactile_node.read_only import read_only
from tactile_node.shape.recognition import Shape, ShapeClass

#: Their own axes run from side to side of them; what a triangle is completed by, its deviations say
UPRIGHT = (Shape.CIRCLE, Shape.SQUARE, Shape.RECTANGLE)


def fit_contact(pattern: ContactPattern, shape: ShapeClass, pitch: float = 1.0, layer: Layer | None = None,
                visibility: Visibility | None = None) -> ShapeFit | None:
    """Fit ``shape`` to the contact of ``pattern`` as `fit_shape` does; ``visibility`` of it, None: not known yet.

    A length of a circle, a square or a rectangle that goes on where nothing is seen is that of what is seen, a bound. A
    triangle is completed, and its deviations say how well.
    """
    taxels = pattern.mask if are_on_off(pattern.values) else pattern.values
    fit = fit_shape(taxels, pattern.mask, shape, pitch, layer)
    if fit is None or fit.shape not in UPRIGHT:
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
    axes = np.array(((np.cos(fit.angle), np.sin(fit.angle)), (-np.sin(fit.angle), np.cos(fit.angle))))
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
