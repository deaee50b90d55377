"""Draw the feature planes of Volf, Dvořák and Vlček's classifier."""

from collections.abc import Mapping
from functools import cache

import numpy as np

from tactile_node.helmholtz.features import Features, Group, compute_features
from tactile_node.package_files import config_path
from tactile_node.shape.recognition import METHOD_FILES, VOLF
from tactile_node.shape.volf import SMALLEST, Plane, VolfClassifier, axes, plane_feature
from tactile_node.viewing.chart import POINT_COLOURS, PlotArea
from tactile_node.viewing.templates import shared

PLANE = PlotArea(30.0, 17.0, 3.2, .4, 1.4, 2.6)


@cache
def _planes() -> Mapping[str, Plane]:
    return VolfClassifier.from_file(config_path(METHOD_FILES[VOLF])).planes


def planes_html(masks: dict[int, np.ndarray]) -> str:
    """Return all planes as SVG, with a point for each pad.

    Parameters
    ----------
    masks
        Masks of the contacts by pad number, bool (rows, cols).
    """
    features = {pad: compute_features(mask, Group.CLASSIFIER) for pad, mask in masks.items()
                if np.count_nonzero(mask) >= SMALLEST}
    drawn = ''.join(_picture(name, plane, features) for name, plane in _planes().items())
    note = '' if features else f'<div class="tactile-note">no contact of {SMALLEST} taxels or more</div>'
    return f'{note}<div class="tactile-planes">{drawn}</div>'


def _picture(name: str, plane: Plane, features: dict[int, Features]) -> str:
    low, high = plane.knots[0], plane.knots[-1]
    horizontal = np.expm1(np.linspace(low, high, 33))
    u, v = axes(horizontal, plane.curve_at(horizontal))
    bottom, top = v.min() - 1.5, v.max() + 1.5

    def place(u, v):
        return PLANE.place(np.clip((u - low) / (high - low), 0, 1), np.clip((v - bottom) / (top - bottom), 0, 1))

    points = {pad: (plane_feature(found, plane.horizontal), plane_feature(found, plane.vertical))
              for pad, found in features.items()}
    ends = np.expm1(low), np.expm1(high), max(np.exp(bottom) - .01, 0), np.exp(top) - .01
    return str(shared().plane(
        PLANE, name, plane, np.column_stack(place(u, v)).tolist(),
        [(place(*map(float, axes(*point))), POINT_COLOURS[pad % len(POINT_COLOURS)])
         for pad, point in points.items() if np.isfinite(point).all()], ends))
