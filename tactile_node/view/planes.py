"""The paper's planes (section 7) with the point of the current contact (SVG); computed only while they are open."""

from typing import NamedTuple

import numpy as np

from tactile_node.helmholtz.features import compute_features
from tactile_node.package_files import config_path
from tactile_node.shape.methods import FILES, VOLF
from tactile_node.shape.plane import Plane, axes
from tactile_node.shape.volf import GROUPS, SMALLEST, VolfClassifier, plane_feature

WIDTH, HEIGHT = 30.0, 17.0
LEFT, BOTTOM, TOP, RIGHT = 3.2, 2.6, 1.4, 0.4
POINTS = '#0ea5e9', '#f97316', '#16a34a', '#a855f7'  #: of the pads, in their order


class PlanePoint(NamedTuple):
    """A contact in one plane."""

    pad: int             #: which one, for its colour
    horizontal: float
    vertical: float


class Planes:
    """The curves of the classifier, read once."""

    def __init__(self) -> None:
        self._planes = VolfClassifier.from_file(config_path(FILES[VOLF])).planes

    def pictures(self, masks: dict[int, np.ndarray]) -> str:
        """Return all planes with a point for each of ``masks``, bool (rows, cols), by the number of the pad."""
        features = {pad: compute_features(mask, GROUPS) for pad, mask in masks.items()
                    if np.count_nonzero(mask) >= SMALLEST}
        pictures = []
        for name, plane in self._planes.items():
            points = [PlanePoint(pad, plane_feature(found, plane.horizontal), plane_feature(found, plane.vertical))
                      for pad, found in features.items()]
            pictures.append(_picture(name, plane, [point for point in points if np.isfinite(point[1:]).all()]))
        note = '' if features else f'<div class="tactile-note">no contact of {SMALLEST} taxels or more</div>'
        return f'{note}<div class="tactile-planes">{"".join(pictures)}</div>'


def _picture(name: str, plane: Plane, points: list[PlanePoint]) -> str:
    low, high = plane.knots[0], plane.knots[-1]
    horizontal = np.expm1(np.linspace(low, high, 33))
    u, v = axes(horizontal, plane.curve_at(horizontal))
    bottom, top = v.min() - 1.5, v.max() + 1.5

    def place(u: float, v: float) -> tuple[float, float]:
        x, y = (u - low) / (high - low), (v - bottom) / (top - bottom)
        return (LEFT + np.clip(x, 0, 1) * (WIDTH - LEFT - RIGHT),
                HEIGHT - BOTTOM - np.clip(y, 0, 1) * (HEIGHT - BOTTOM - TOP))

    curve = ' '.join(f'{x:.2f},{y:.2f}' for x, y in (place(*each) for each in zip(u, v)))
    right, below = WIDTH - RIGHT, HEIGHT - BOTTOM
    marks = ''
    for point in points:
        x, y = place(*map(float, axes(point.horizontal, point.vertical)))
        marks += f'<circle class="plane-point" cx="{x:.2f}" cy="{y:.2f}" r=".5" fill="{POINTS[point.pad % 4]}"/>'
    label = name.replace('_', ' ')
    return (f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" font-size="1.05" fill="#5c6672">'
            f'<polygon points="{LEFT},{TOP} {right},{TOP} {right},{curve.split()[-1].split(",")[1]} '
            f'{" ".join(reversed(curve.split()))} {LEFT},{TOP}" fill="#0ea5e9" opacity=".12"/>'
            f'<rect x="{LEFT}" y="{TOP}" width="{right - LEFT}" height="{below - TOP}" fill="none" stroke="#5c6672" '
            f'stroke-width=".08"/><polyline points="{curve}" fill="none" stroke="#5c6672" stroke-width=".18"/>{marks}'
            f'<text x="{LEFT + .4}" y="{TOP + 1.3}">{label} above the curve</text>'
            + _scale(plane, (low, high), (bottom, top), place)
            + f'<text x="{right}" y="{HEIGHT - .2}" text-anchor="end">{" ".join(plane.horizontal)}</text>'
            f'<text x=".1" y="{TOP - .3}">{" ".join(plane.vertical)}</text></svg>')


def _scale(plane: Plane, horizontal: tuple[float, float], vertical: tuple[float, float], place) -> str:
    """Numbers at both ends of each axis, in the features' own units."""
    (left, bottom), (right, top) = place(horizontal[0], vertical[0]), place(horizontal[1], vertical[1])
    numbers = [(left, bottom + 1.2, 'start', np.expm1(horizontal[0])), (right, bottom + 1.2, 'end',
               np.expm1(horizontal[1])), (left - .2, bottom, 'end', max(np.exp(vertical[0]) - .01, 0)),
               (left - .2, top + .9, 'end', np.exp(vertical[1]) - .01)]
    return ''.join(f'<text x="{x:.2f}" y="{y:.2f}" text-anchor="{anchor}" font-size=".9">{value:.3g}</text>'
                   for x, y, anchor, value in numbers)
