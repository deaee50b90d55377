"""Noise, spread of the gains and halo of a skin, from touches of any objects."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED, grown
from tactile_node.contact.press import are_on_off
from tactile_node.learning.touches import TouchFrame

AROUND = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]])  #: neighbours of a taxel
LEAST_NEIGHBOURS = 5  #: fewest neighbours in the contact, for a taxel to be compared with them
OFTEN = 8             #: touches in which a taxel must be inside a contact
LEAST_TAXELS = 20     #: fewest taxels that were inside so often, for a spread of the gains
REST_DISTANCE = 4     #: distance from the contact beyond which taxels are at rest [taxels]


class SkinMeasures(NamedTuple):
    """Measures of a skin; each is NaN if it is not known, as for on/off taxels."""

    noise: float  #: standard deviation of a taxel at rest [share of the contact's level]
    gains: float  #: standard deviation of the logarithm of the taxels' gains
    halo: float   #: reading two taxels beside a contact, all round it [share of the contact's level]

    def __str__(self) -> str:
        return '; '.join(f'{name} {_percent(value)}' for name, value in zip(
            ('noise at rest', 'spread of the gains', 'halo two taxels beside a contact'), self))


def measure_skin(frames: Sequence[TouchFrame]) -> SkinMeasures:
    """Return the measures of the skin of one pad. ``frames``: one of each touch."""
    raised = [(frame, frame.reading - _rest(frame)) for frame in frames
              if not are_on_off(frame.reading[np.isfinite(frame.reading)])]
    levels = [float(np.nanmedian(values[frame.mask])) for frame, values in raised]
    noise = [_median(frame.pattern.noise) / level for (frame, _), level in zip(raised, levels)]
    halo = [_skirt(values, frame.mask) / level for (frame, values), level in zip(raised, levels)]
    residuals = [residual(values, frame.mask, float(np.nanmax(values))) for frame, values in raised]
    of_taxels = [of for of in by_place(residuals) if len(of) >= OFTEN]
    gains = fixed_part(of_taxels)[0] if len(of_taxels) >= LEAST_TAXELS else np.nan
    return SkinMeasures(_median(np.array(noise)), gains, _median(np.array(halo)))


def residual(frame: np.ndarray, mask: np.ndarray, largest: float) -> np.ndarray:
    """Return the log of each reading in a contact less that of its neighbours in it; NaN where they are too few."""
    valid = mask & (frame > 0) & (frame < largest)
    logs = np.where(valid, np.log(np.maximum(frame, 1e-9)), 0.0)
    count, total = (ndimage.convolve(of.astype(float), AROUND, mode='constant') for of in (valid, logs))
    of_whole = valid & (count >= LEAST_NEIGHBOURS)
    count = np.maximum(count, 1)
    return np.where(of_whole, (logs - total / count) / np.sqrt(1 + 1 / count), np.nan)


def fixed_part(residuals: Iterable[np.ndarray]) -> tuple[float, float]:
    """Return the standard deviations of what stays from frame to frame, and of what changes; by one-way variances."""
    own = [one for one in residuals if len(one) >= OFTEN]
    if len(own) < 2:
        return np.nan, np.nan
    within = np.mean([one.var(ddof=1) for one in own])
    between = np.var([one.mean() for one in own], ddof=1) - within * np.mean([1 / len(one) for one in own])
    return float(np.sqrt(max(between, 0))), float(np.sqrt(within))


def by_place(residuals: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the valid values of each taxel or line, over the frames."""
    stacked = np.reshape(residuals, (len(residuals), -1)).T if residuals else np.zeros((0, 0))
    return [of[np.isfinite(of)] for of in stacked]


def _rest(frame: TouchFrame) -> float:
    """Return the median reading of the taxels far from the contact, or 0 if there are none."""
    near = ndimage.binary_dilation(frame.mask, EIGHT_CONNECTED, iterations=REST_DISTANCE)
    far = frame.reading[~near & np.isfinite(frame.reading)]
    return float(np.median(far)) if far.size else 0.0


def _skirt(values: np.ndarray, mask: np.ndarray) -> float:
    """Return the lower quartile of the readings two taxels beside the contact ``mask``."""
    near = grown(mask)
    skirt = values[grown(near) & ~near & np.isfinite(values)]
    return float(np.quantile(skirt, 0.25)) if skirt.size else np.nan


def _median(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else np.nan


def _percent(value: float) -> str:
    return f'{100 * value:.1f} %' if np.isfinite(value) else 'not known'
