"""Measure how an array changes the contacts on it, as a set of named quantities."""

from collections import defaultdict
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED
from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.learning.skin_measures import OFTEN, by_place, fixed_part, residual
from tactile_node.shape.patch import joined

LEAST = 9    #: Smallest number of taxels in a measured contact.
PAIRS = 200  #: Smallest number of taxel pairs for a correlation.
LONG = 3.0   #: Smallest ratio of length to width of a bar, computed from second moments.
AWAY = 3     #: Readings at this or a larger distance from a contact count as cross-talk [taxels].
STAMP = 8.0    #: Shortest measured imprint [s].
RATE = 30.0    #: Frame rate of the recordings [1/s].
PLATEAU = 0.2  #: The stamp presses while the sum of readings exceeds this share of the highest sum.


class ArrayGroup(NamedTuple):
    """Frames of one array or of one pad."""

    frames: list[np.ndarray]
    largest: float  #: full-scale reading


def alike(residuals: list[np.ndarray], distance: int) -> float:
    """Return the correlation of residuals between taxels at ``distance`` in a row or column."""
    pairs = [(one[:, :-distance], one[:, distance:]) for one in residuals]
    pairs += [(one[:-distance], one[distance:]) for one in residuals]
    one, other = (np.concatenate([pair[k].ravel() for pair in pairs]) for k in (0, 1))
    both = np.isfinite(one) & np.isfinite(other)
    return float(np.corrcoef(one[both], other[both])[0, 1]) if both.sum() >= PAIRS else np.nan


def around(frame: np.ndarray, pattern: ContactPattern, mask: np.ndarray) -> dict[str, float]:
    """Return the mean readings in several regions outside a contact, as shares of the contact's median reading."""
    level, rest = np.median(frame[mask]), ~ndimage.binary_dilation(pattern.labels > 0, EIGHT_CONNECTED, AWAY - 1)
    rows, cols = (mask.any(axis)[shape] for axis, shape in ((1, np.s_[:, None]), (0, np.s_[None, :])))
    ring = ndimage.binary_dilation(mask, EIGHT_CONNECTED) & ~mask
    second = ndimage.binary_dilation(mask, EIGHT_CONNECTED, 2) & ~mask & ~ring
    places = {'ring': ring, 'second': second, 'row': rest & rows, 'column': rest & cols, 'away': rest & ~rows & ~cols}
    return {name: float(frame[of].mean() / level) for name, of in places.items() if of.any()}


def elongation(mask: np.ndarray) -> float:
    low, high = np.linalg.eigvalsh(np.cov(*mask.nonzero()) + np.eye(2) / 12)
    return float(np.sqrt(high / low))


def measure(groups: list[ArrayGroup]) -> dict[str, str]:
    """Return the value of each quantity as text."""
    taxels, rows, cols, residuals, outside = [], [], [], [], defaultdict(list)
    sizes, edges, hollow, bars, whole_range = [], [], 0, 0, []
    for group in groups:
        own = []
        for frame in group.frames:
            pattern = PatternExtractor().extract(frame)
            mask = joined(pattern) if pattern.contacts else pattern.mask
            if mask.sum() < LEAST:
                continue
            sizes.append(int(mask.sum()))
            edges.append(sum(map(bool, (mask[0].any(), mask[-1].any(), mask[:, 0].any(), mask[:, -1].any()))))
            hollow += ndimage.binary_fill_holes(mask).sum() - mask.sum() >= 2
            bars += elongation(mask) >= LONG
            whole_range.append(np.divide(*np.quantile(frame[mask], (0.9, 0.1))))
            for place, share in around(frame, pattern, mask).items():
                outside[place].append(share)
            own.append(residual(frame, mask, group.largest))
        taxels += by_place(own)
        with np.errstate(all='ignore'):
            rows += by_place([np.array([_mean(line) for line in one]) for one in own])
            cols += by_place([np.array([_mean(line) for line in one.T]) for one in own])
        residuals += own
    gain, speckle = fixed_part(taxels)
    every = np.concatenate([one[np.isfinite(one)] for one in residuals]) if residuals else np.zeros(1)
    lines = [fixed_part(of)[0] for of in (rows, cols)]
    weakest = [min((one.mean() for one in of if len(one) >= OFTEN), default=np.nan) for of in (rows, cols)]
    share = {place: float(np.mean(of)) for place, of in outside.items()}
    return {
        'contacts, median of taxels': f'{len(sizes)}, {np.median(sizes):.0f}',
        'touch 0 / 1 / 2 or more edges': _percents(
            np.mean(of) for of in (np.equal(edges, 0), np.equal(edges, 1), np.greater(edges, 1))),
        'hollow: enclosing at least 2 taxels': _percents([hollow / len(sizes)]),
        f'bars: longer than {LONG:g}:1': _percents([bars / len(sizes)]),
        'readings in a contact, 90 % to 10 %': f'{np.median(whole_range):.1f} : 1',
        'spread about the neighbours': _number(every.std()),
        'part of it that stays with the taxel (gain)': _number(gain),
        'part of it that changes (speckle)': _number(speckle),
        'correlation at 1 / 2 / 3': ' / '.join(_number(alike(residuals, k)) for k in (1, 2, 3)),
        'gain of rows / columns': ' / '.join(map(_number, lines)),
        'weakest row / column': ' / '.join(_number(np.exp(of)) for of in weakest),
        'first / second ring around': _percents(share.get(place, np.nan) for place in ('ring', 'second')),
        'cross-talk: row / column / elsewhere': _percents(
            share.get(place, np.nan) for place in ('row', 'column', 'away'))}


def measure_over_time(rest: list[np.ndarray], stamped: dict[float, np.ndarray]) -> dict[str, str]:
    """Return noise and drift of pads that warm up at ``rest``, and creep of a pad ``stamped`` with weights [g]."""
    first, last = (np.concatenate([pad[of].mean(0).ravel() for pad in rest]) for of in (np.s_[:30], np.s_[-30:]))
    quiet = np.concatenate([np.diff(pad, axis=0).std(0).ravel() for pad in rest])[first > 0] / np.sqrt(2)
    creep, remains, loaded, ends = [], [], [], []
    for weight, pad in stamped.items():
        total = pad.sum((1, 2))
        pressed, count = ndimage.label(total > PLATEAU * total.max())
        for k in range(1, count + 1):
            at = np.flatnonzero(pressed == k)
            if len(at) < STAMP * RATE:
                continue
            early, late = at[int(RATE):int(1.5 * RATE)], at[-int(2 * RATE):-int(RATE)]
            creep.append(total[late].mean() / total[early].mean())
            remains.append(total[at[-1] + int(RATE):at[-1] + int(2 * RATE)].mean() / total[late].mean())
            held = pad[late][:, pad[late].mean(0) > 5 * pad[late].mean()]
            loaded.append(np.median(np.diff(held, axis=0).std(0) / np.sqrt(2) / held.mean(0)))
            ends.append((weight, total[late].mean()))
    slope = np.polyfit(*np.log(ends).T, 1)[0]
    return {
        'noise at rest [counts of 4095]': f'{np.median(quiet):.2f} (median), {quiet.max():.1f} (largest taxel)',
        'drift as the hand warms up [counts]': f'{np.median((last - first)[first > 0]):.1f}',
        'noise under load': f'{_percents([np.median(loaded)])} of the reading',
        'growth under a constant weight, from 1 s to its end': f'{np.median(creep):.2f} x ({len(creep)} imprints)',
        'reading 1 to 2 s after the weight was removed': _percents([np.nanmedian(remains)]),
        'sum of the readings': f'weight to the power {slope:.2f}'}


def _mean(line: np.ndarray) -> float:
    return float(np.nanmean(line)) if np.isfinite(line).sum() >= 3 else np.nan


def _number(value: float) -> str:
    return f'{value:.2f}'.replace('-0.00', '0.00') if np.isfinite(value) else '-'


def _percents(shares: Iterable[float]) -> str:
    return ' / '.join(f'{100 * share:.{int(share < 0.1)}f}' for share in shares) + ' %'
