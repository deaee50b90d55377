"""Find the likeliest outline of a shape, by a search from several starting points or by following the last outline."""

import numpy as np

from tactile_node.pose.candidate import Candidate, first_guesses, nearest_zero
from tactile_node.pose.evidence import Evidence
from tactile_node.pose.outlines import OUTLINES
from tactile_node.pose.profiles import DOMES, Layer
from tactile_node.shape.recognition import Shape

SEARCH_PERIOD = 0.5   #: Interval at which the outline of a lasting contact is searched for again [s].
SEARCH_GROWTH = 1.25  #: Growth factor of the evidence after which the outline is searched for again.
WORSE_RATIO = 1.4  #: Factor by which a residual may grow before the outline is searched for again.
LEAST_RESIDUAL = 0.03  #: WORSE_RATIO is applied to this residual if the search has found a smaller one.

#: Corners of a triangle are tried if their angles, or the logarithms of their side ratios, differ by at most this.
CORNER_MARGIN = 0.15
CORNER_MARGIN_ON_OFF = 0.35  #: Value of CORNER_MARGIN for on/off taxels.
PUNCH_RATIO = 1.4  #: A punch fit is not refined if a dome fit's sum of squares is smaller by this factor.

#: A fit is not refined if its misfit after the coarse pass exceeds the best misfit by more than this.
HOPELESS_MISFIT = 500.0
AMBIGUOUS_MISFIT = 6.0  #: Two fits cannot be distinguished if their sums of squares differ by less than this.

#: At the pad's edge, AMBIGUOUS_MISFIT is larger by this factor, because the part beyond the edge is a guess.
EDGE_AMBIGUITY = 20.0


class OutlineFit:
    """Fits the outline of one shape to a contact, from frame to frame.

    Following the outline from the previous frame takes a quarter of the time that a search takes. `estimate` searches
    again in these cases:

    - in the first frame,
    - every SEARCH_PERIOD, because a dome or another corner may have become more likely,
    - if the outline cannot be followed, or if following the outline leads to a worse fit,
    - if the evidence has grown by SEARCH_GROWTH. A contact under light pressure, or seen only in part, may look like a
      dome, whose outline is larger.

    A search has four stages. It fits `Candidate` objects coarsely from all starting points, and weighs the taxels by
    the residuals of the best candidate. It then refines the hopeful candidates. Finally, it takes the estimate of the
    best candidate, and widens the covariance by the distance to the other candidates.

    Parameters
    ----------
    shape : Shape
        One of the five shapes.

    Attributes
    ----------
    shape : Shape
        The shape that is fitted.
    best : Candidate
        The likeliest candidate in the latest frame. Like the results below, it exists after the first search.
    residual : float
        Residual of ``best``.
    parameters : np.ndarray
        Parameters of the outline, in pitches and radians. One pitch is the side of a block of the evidence. The long
        side comes first, and the angle is the equivalent angle nearest 0.
    covariance : np.ndarray
        Covariance of ``parameters``.
    handedness : int
        1, or -1 if the outline is mirrored.
    symmetry : int
        The outline looks the same after a rotation by 2π/symmetry.
    """

    best: Candidate
    residual: float
    parameters: np.ndarray
    covariance: np.ndarray
    handedness: int
    symmetry: int
    _others: np.ndarray     # part of the covariance due to other, nearly as likely outlines in the latest search
    _searched: Candidate    # the best candidate of the latest search
    _most_residual: float   # residual above which the outline is searched for again
    _stamp: float | None    # stamp of the frame of the latest search [s]

    def __init__(self, shape: Shape):
        self.shape = shape
        self._stamp = None

    def estimate(self, evidence: Evidence, layer: Layer | None = None, stamp: float = 0.0) -> None:
        """Fit the outline to the next frame.

        Parameters
        ----------
        evidence : Evidence
            Taxels to which the outline is fitted.
        layer : Layer or None
            Layer of a calibrated skin, with lengths in pitches, or None if the layer is unknown.
        stamp : float
            Acquisition time of the frame [s].
        """
        if self._stamp is None or not 0 <= stamp - self._stamp < SEARCH_PERIOD or not self.follow(evidence):
            self.search(evidence, layer)
            self._stamp = stamp

    def search(self, evidence: Evidence, layer: Layer | None = None) -> None:
        """Search for the outline from several starting points. The parameters are those of `estimate`."""
        candidates = self._coarse_candidates(evidence, layer)
        weights = min(candidates, key=_misfit).new_weights()
        candidates = [candidate.weighted(weights).with_likely_peak() for candidate in candidates]
        within = min(map(_misfit, candidates)) + HOPELESS_MISFIT
        candidates = sorted((each.fine() for each in candidates if each.misfit < within), key=_misfit)
        self._conclude(evidence, candidates)
        self.best = self._searched = candidates[0]
        self.residual = self.best.residual
        self._most_residual = WORSE_RATIO * max(self.residual, LEAST_RESIDUAL)

    def follow(self, evidence: Evidence) -> bool:
        """Follow the outline from the previous frame, or return False if a new search is needed.

        The part of the covariance due to other outlines is kept from the latest search.
        """
        before = self._searched.evidence
        is_alike = (evidence.on_off, evidence.at_edge) == (before.on_off, before.at_edge)
        has_same_blocks = (evidence.size, evidence.x, evidence.y) == (before.size, before.x, before.y)
        if not (is_alike and has_same_blocks) or evidence.strength > SEARCH_GROWTH * before.strength:
            return False
        found = self.best.followed(evidence)
        if found is None or (residual := found.residual) > self._most_residual:
            return False
        parameters, covariance, handedness = found.estimate()
        self.best, self.residual, self.parameters, self.handedness = found, residual, parameters, handedness
        self.covariance = covariance + self._others
        return True

    def _coarse_candidates(self, evidence: Evidence, layer: Layer | None) -> list[Candidate]:
        """Return candidates from every starting point, including domes if the contact may be a dome."""
        y, x = np.indices(evidence.solid.shape).reshape(2, -1)
        margin = np.inf if evidence.at_edge else CORNER_MARGIN_ON_OFF if evidence.on_off else CORNER_MARGIN
        starts = first_guesses(self.shape, x + evidence.window.col, y + evidence.window.row,
                               evidence.solid.reshape(-1), margin)
        punches = [Candidate.coarse(evidence, self.shape, start, layer=layer) for start in starts]
        if not punches[0].may_be_dome():
            return punches
        domes = [Candidate.coarse(evidence, self.shape, starts[0], dome, layer) for dome in DOMES[self.shape]]
        if punches[0].is_no_punch():
            return domes
        # A punch fit that is worse than a dome fit is dropped. Otherwise the new weights would treat the dome's tip as
        # outliers, and the rest would look like an even pressure on an outline that is too small.
        least = min(map(_misfit, domes))
        return [punch for punch in punches if punch.misfit < PUNCH_RATIO * least] + domes

    def _conclude(self, evidence: Evidence, candidates: list[Candidate]) -> None:
        """Set the results from the refined ``candidates``, the best first."""
        estimates = [candidate.weighted(candidate.new_weights()).estimate() for candidate in candidates]
        costs = np.array([candidate.misfit for candidate in candidates])
        if evidence.at_edge and not evidence.on_off:
            costs /= EDGE_AMBIGUITY
        self.parameters, covariance, self.handedness = estimates[0]
        self.symmetry = OUTLINES[self.shape].symmetry
        apart = [parameters - self.parameters for parameters, _, _ in estimates]
        if self.shape is Shape.ISOSCELES_TRIANGLE and any(
                cost - costs[0] < AMBIGUOUS_MISFIT and abs(nearest_zero(away[2], 1)) > 1
                for cost, away in zip(costs[1:], apart[1:])):
            self.symmetry = 3
        shares = np.exp((costs[0] - costs) / 2)
        self.covariance, self._others = np.zeros((2, *covariance.shape))
        for share, away, (_, own, _) in zip(shares / shares.sum(), apart, estimates):
            if self.symmetry:
                away[2] = nearest_zero(away[2], self.symmetry)
            spread = np.outer(away, away)
            self.covariance += share * (own + spread)
            self._others += share * spread


def _misfit(candidate: Candidate) -> float:
    """Return the misfit, by which candidates are compared because their costs contain different priors."""
    return candidate.misfit
