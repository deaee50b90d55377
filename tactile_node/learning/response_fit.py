"""Find the response of a skin with which fits of a known disc return the disc's true size.

If the readings do not grow in proportion to the pressure, the edge of a contact appears in the wrong place, and the
fitted lengths show this error (docs/pose_results.md). The curve has a local exponent: for each unit of log reading, log
pressure rises by ``exponent`` + ``bend`` log(reading / middle). The depth of the taxels follows from the fits under
this curve.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from tactile_node.conditioning.gain import ResponseCurve
from tactile_node.errors import InputError
from tactile_node.learning.response import SkinResponse
from tactile_node.learning.touches import Touch
from tactile_node.pose.fit import ShapeFit, fit_shape
from tactile_node.pose.profiles import PUNCH, Indenter, Layer, log_depth_from
from tactile_node.shape.recognition import Shape
from tactile_node.taxel_frame import read_only

#: Smallest number of presses. Each press must be at a different position, because every position has its own error.
LEAST_PRESSES = 6
PRESS_ERROR = 0.01      #: Relative error of the lengths in a single press.
PRIOR_SPREADS = 0.5, 0.15       #: Prior standard deviations of exponent - 1 and of bend.
EXPONENTS, BENDS = (0.4, 2.5), (-0.4, 0.4)
CURVE_NODES = 16              #: Number of nodes of the curve, which are spaced geometrically.
LOWEST_SHARE = 0.5            #: Share of the lightest press below which the curve is a line through 0.

#: Step for numerical derivatives. The step is large because fits stop at a finite accuracy.
DERIVATIVE_STEP = 0.02
#: Largest radius of a disc [m]. On the coarsest skins, a disc with a radius of 10 pitches has half of this radius.
LARGEST_RADIUS = 0.25
#: Largest edge radius relative to the disc's radius. With a larger edge radius, the face is not flat.
MOST_ROUNDED = 0.3
LAYER_ERROR = 0.08      #: Standard deviation of the error in log depth that all presses of one disc share.

#: Largest relative error of the lengths after calibration. A larger error means that another disc was pressed.
LARGEST_ERROR = 0.03
BOUND_MARGIN = 0.02         #: An exponent closer to its bound than this is not a valid result.

#: Relative error by which a fit overestimates a flat disc with sharp edges, and the change of this error per unit of
#: edge radius / inscribed radius. Fits are correct on average, but edges differ (bench/bench_calibration.py --edges
#: at commit ecd333e6).
SHARP_ERROR, OF_ROUNDING = 0.019, -0.125


class Disc(NamedTuple):
    """The flat face of a rigid cylinder.

    Other shapes cannot be used, because their corners carry less pressure than fits expect.
    """

    radius: float             #: [m]
    edge_radius: float = 0.0  #: radius of the rounded edge [m]

    @property
    def fit_error(self) -> float:
        """Relative error by which a fit is expected to overestimate the disc if the response is known."""
        return SHARP_ERROR + OF_ROUNDING * self.edge_radius / self.radius


class FoundResponse(NamedTuple):
    """A response, and the errors of the disc's radius with and without the response."""

    response: SkinResponse
    exponent: float
    bend: float
    before: float    #: median relative error of the disc's radius without the response
    after: float     #: median relative error with the response
    left_out: float  #: median relative error for each half of the presses, with the response found from the other half


def calibrate(presses: Sequence[Touch], known: Disc, pitch: float, unit: str,
              progress: Callable[[int], None] = lambda fits: None) -> FoundResponse:
    """Return the response with which fits of a known disc return the disc's size.

    Parameters
    ----------
    presses : sequence of Touch
        Presses of the disc.
    known : Disc
        The disc.
    pitch : float
        Distance between neighbouring taxels [m].
    unit : str
        Unit of the readings.
    progress : callable
        Function called with the number of new fits whenever some fits are done.

    Raises
    ------
    InputError
        Raised if there are too few presses, the radius is not a length above 0, the object has no flat face, or no
        response leads to the disc's size.
    """
    check_disc(known)
    if len(presses) < LEAST_PRESSES:
        raise InputError('presses of a known disc', expected=f'at least {LEAST_PRESSES}', got=str(len(presses)),
                         remedy='Press the disc more often, at different places, and lift it between presses.')
    search = _Search(presses, known, pitch, progress)
    if search.dome_share() > 0.5:
        raise InputError('presses of a known disc', expected='a flat face', got='the pressure of a ball or a cone',
                         remedy='Press the flat end of a rigid cylinder.')
    exponent, bend = search.best()
    halves = [_Search(presses[first::2], known, pitch, progress) for first in (0, 1)]
    left_out = np.concatenate([other.errors(search.curve(*half.best())) for half, other in zip(halves, halves[::-1])])
    curve = search.curve(exponent, bend)
    found = FoundResponse(SkinResponse(unit, search.layer(curve), curve), exponent, bend,
                        before=float(np.median(search.errors(None))), after=float(np.median(search.errors(curve))),
                        left_out=float(np.median(left_out)))
    largest = max(found.after, found.left_out, key=abs)
    is_at_bound = not EXPONENTS[0] + BOUND_MARGIN < exponent < EXPONENTS[1] - BOUND_MARGIN
    if abs(largest) > LARGEST_ERROR or is_at_bound:
        raise InputError('presses of a known disc',
                         got=f'fits that are {100 * largest:+.1f} % too large, under an exponent of {exponent:.2f}',
                         expected=f'a response under which a radius of {1000 * known.radius:g} mm fits',
                         remedy='Check the radius and the pitch. The face that touches the skin must be flat.')
    return found


class _Search:
    """The fits of some presses under different curves."""

    def __init__(self, presses: Sequence[Touch], known: Disc, pitch: float,
                 progress: Callable[[int], None]):
        self._frames = [frame for press in presses for frame in press.frames]
        counts = np.array([len(press.frames) for press in presses])
        self._weights = np.repeat(counts ** -0.5, counts) / PRESS_ERROR
        self._known, self._pitch, self._progress = known, pitch, progress
        levels = np.array([np.nanmean(frame.values[frame.mask]) for frame in self._frames])
        self._middle = float(np.exp(np.median(np.log(levels))))
        self._lightest, self._hardest = float(levels.min()), float(levels.max())
        self._highest = max(float(np.nanmax(frame.values)) for frame in self._frames)

    def curve(self, exponent: float, bend: float) -> ResponseCurve:
        """Return the curve with ``exponent`` and ``bend``.

        The curve keeps the level of the lightest press, so that light contacts stay visible. The exponent is known
        between the lightest and the hardest press. Beyond this range, the exponent keeps its value at the nearer end.
        Far below the lightest press, the curve is a line through 0.
        """
        readings = np.geomspace(LOWEST_SHARE * self._lightest, self._highest, CURVE_NODES)
        fine = np.linspace(np.log(readings[0] / self._middle), np.log(readings[-1] / self._middle), 40 * CURVE_NODES)
        known = np.clip(fine, np.log(self._lightest / self._middle), np.log(self._hardest / self._middle))
        slope = np.clip(exponent + bend * known, *EXPONENTS)
        logs = np.concatenate(([0.0], np.cumsum((slope[1:] + slope[:-1]) / 2 * np.diff(fine))))
        logs += np.log(self._lightest / self._middle) - np.interp(np.log(self._lightest / self._middle), fine, logs)
        pressures = self._middle * np.exp(np.interp(np.log(readings / self._middle), fine, logs))
        return ResponseCurve(read_only(np.concatenate(([0.0], readings))),
                             read_only(np.concatenate(([0.0], pressures))))

    def best(self) -> tuple[float, float]:
        """Return the best exponent and bend."""
        def residuals(parameters: np.ndarray) -> np.ndarray:
            exponent, bend = parameters
            found = self.errors(self.curve(exponent, bend)) * self._weights
            prior = np.array((exponent - 1, bend)) / PRIOR_SPREADS
            return np.concatenate((np.arctan(found / 3) * 3, prior))
        low, high = zip(EXPONENTS, BENDS)
        solution = least_squares(residuals, (1.0, 0.0), bounds=(low, high), diff_step=DERIVATIVE_STEP,
                                 x_scale=(1.0, 0.3), xtol=1e-3, ftol=1e-4)
        return float(solution.x[0]), float(solution.x[1])

    def errors(self, curve: ResponseCurve | None) -> np.ndarray:
        """Return the relative error of the disc's radius in each frame, minus the expected error of a fit."""
        radii = np.array([fit.dimensions[0] for fit in self._fits(curve)])
        return radii / self._known.radius - 1 - self._known.fit_error

    def dome_share(self) -> float:
        """Return the share of the frames in which a round object presses, judged by the readings before conversion."""
        return float(np.mean([fit.indenter is not Indenter.FLAT_PUNCH for fit in self._fits(None)]))

    def layer(self, curve: ResponseCurve) -> Layer:
        """Return the layer from the depths that fits find under ``curve``."""
        found = []
        for fit in self._fits(curve):
            found.append(log_depth_from(fit.depth, PUNCH, fit.dimensions[0], self._pitch))
        own = np.std(found) / np.sqrt(len(found))
        return Layer(float(np.exp(np.median(found))), float(np.hypot(own, LAYER_ERROR)))

    def _fits(self, curve: ResponseCurve | None) -> list[ShapeFit]:
        fits = []
        for frame in self._frames:
            values = frame.values if curve is None else curve(frame.values)
            fit = fit_shape(values, frame.mask, Shape.CIRCLE, self._pitch)
            assert fit is not None  # a circle has an outline
            fits.append(fit)
        self._progress(len(fits))
        return fits


def check_disc(known: Disc) -> None:
    """Raise InputError if the dimensions of a disc are invalid."""
    if not (0 < known.radius <= LARGEST_RADIUS and 0 <= known.edge_radius <= MOST_ROUNDED * known.radius):
        raise InputError('known disc', got=f'radius {known.radius:g} m, edge radius {known.edge_radius:g} m',
                         expected=f'a radius > 0, at most {LARGEST_RADIUS:g} m, and an edge rounded to at most '
                         f'{MOST_ROUNDED:g} of it',
                         remedy='Give the lengths in metres, for example 0.0125 for 12.5 mm.')
