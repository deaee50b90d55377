"""Measure the noise, the spread of the gains and the halo of a skin from touches of any objects."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED, grown
from tactile_node.contact.press import are_on_off
from tactile_node.learning.touches import TouchFrame

AROUND = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]])  #: Neighbours of a taxel.

#: A taxel is compared with its neighbours only if at least this many of them belong to the contact.
LEAST_NEIGHBOURS = 5
OFTEN = 8           #: Number of touches in which a taxel has to be inside a contact for its gain to be measured.
LEAST_TAXELS = 20   #: Smallest number of taxels with a measured gain from which the spread of the gains is computed.
REST_DISTANCE = 4   #: Distance from the contact beyond which taxels are at rest [taxels].


class SkinMeasures(NamedTuple):
    """Measured properties of a skin. Unknown properties are NaN, as are all properties of on/off taxels."""

    noise: float  #: standard deviation of a taxel at rest, as a share of the contact's level
    gains: float  #: standard deviation of the taxels' log gains
    halo: float   #: reading around a contact at a distance of two taxels, as a share of the contact's level

    def __str__(self) -> str:
        return '; '.join(f'{name} {_percent(value)}' for name, value in zip(
            ('noise at rest', 'spread of the gains', 'halo two taxels beside a contact'), self))


def measure_skin(frames: Sequence[TouchFrame]) -> SkinMeasures:
    """Return the measured properties of one pad's skin.

    Parameters
    ----------
    frames : Sequence[TouchFrame]
        One frame of each touch. Frames with on/off taxels are not used.
    """
    raised = [(frame, _raised(frame)) for frame in frames if not are_on_off(frame.reading[np.isfinite(frame.reading)])]
    levels = [float(np.nanmedian(values[frame.mask])) for frame, values in raised]
    noise = [_median(frame.pattern.noise) / level for (frame, _), level in zip(raised, levels)]
    halo = [_skirt(values, frame.mask) / level for (frame, values), level in zip(raised, levels)]
    residuals = [_residual(values, frame.mask) for frame, values in raised]
    by_taxel: Iterable[np.ndarray] = np.reshape(residuals, (len(residuals), -1)).T if residuals else []
    touched_often = [known for of in by_taxel if len(known := of[np.isfinite(of)]) >= OFTEN]
    gains = _fixed_part(touched_often) if len(touched_often) >= LEAST_TAXELS else np.nan
    return SkinMeasures(_median(np.array(noise)), gains, _median(np.array(halo)))


def _residual(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return how far the logarithm of each reading in a contact deviates from that of its neighbours, (rows, cols).

    The deviations are scaled so that they have the variance of a single taxel. A taxel with fewer than LEAST_NEIGHBOURS
    usable neighbours is NaN. The highest readings are not usable, because they may lie at the end of the range.
    """
    valid = mask & (values > 0) & (values < float(np.nanmax(values)))
    logs = np.where(valid, np.log(np.maximum(values, 1e-9)), 0.0)
    count, total = (ndimage.convolve(of.astype(float), AROUND, mode='constant') for of in (valid, logs))
    of_whole = valid & (count >= LEAST_NEIGHBOURS)
    count = np.maximum(count, 1)
    return np.where(of_whole, (logs - total / count) / np.sqrt(1 + 1 / count), np.nan)


def _fixed_part(residuals: Sequence[np.ndarray]) -> float:
    """Return the standard deviation of the part of the residuals that each taxel keeps in all frames.

    ``residuals`` holds the residuals of each taxel, which are compared by one-way analysis of variance.
    """
    within = np.mean([one.var(ddof=1) for one in residuals])
    between = np.var([one.mean() for one in residuals], ddof=1) - within * np.mean([1 / len(one) for one in residuals])
    return float(np.sqrt(max(between, 0)))


def _raised(frame: TouchFrame) -> np.ndarray:
    return frame.reading - _rest(frame)


def _rest(frame: TouchFrame) -> float:
    """Return the median reading of the taxels far from the contact, or 0 if there are no such taxels."""
    near = ndimage.binary_dilation(frame.mask, EIGHT_CONNECTED, iterations=REST_DISTANCE)
    far = frame.reading[~near & np.isfinite(frame.reading)]
    return float(np.median(far)) if far.size else 0.0


def _skirt(values: np.ndarray, mask: np.ndarray) -> float:
    """Return the lower quartile of the readings two taxels away from the contact ``mask``."""
    near = grown(mask)
    skirt = values[grown(near) & ~near & np.isfinite(values)]
    return float(np.quantile(skirt, 0.25)) if skirt.size else np.nan


def _median(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else np.nan


def _percent(value: float) -> str:
    return f'{100 * value:.1f} %' if np.isfinite(value) else 'not known'
