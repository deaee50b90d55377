"""What was sent, what arrived, what was counted as lost on the way: nothing may be left. And how cost grows."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import t


class Station(NamedTuple):
    """Counts of the messages of one kind of node; received = processed + overtaken + dropped."""

    received: int = 0
    processed: int = 0
    skipped: int = 0    #: gaps in the sequence that no node before it has counted as left out
    overtaken: int = 0  #: left out on purpose, for newer ones
    dropped: int = 0

    def __sub__(self, before: 'Station') -> 'Station':
        return Station(*(now - then for now, then in zip(self, before)))

    def __add__(self, other: 'Station') -> 'Station':  # type: ignore[override]
        return Station(*(one + two for one, two in zip(self, other)))


class Counts(NamedTuple):
    """Of a session from activation to deactivation, all buses together; both ends are at rest."""

    pads: int
    tpdos: int            #: of a sweep
    syncs_left_out: int   #: that the drivers did not send: overruns (they were too slow) and pauses (the bus was full)
    sweeps: int           #: that the devices sent
    sweeps_skipped: int   #: that they left out because those before were not sent
    unread: int           #: CAN frames that the driver had not read when the adapter was full
    queue_overruns: int   #: CAN frames that the driver had no room for
    received: int         #: TPDOs
    used: int
    missing: int          #: TPDOs of the taxel frames, as the driver reports: expected and not used
    lost: int             #: TPDOs lost for a named reason
    outages: int          #: of nodes
    published: int        #: taxel frames
    processor: Station
    classifier: Station

    def __sub__(self, before: 'Counts') -> 'Counts':
        return Counts(*self[:2], *(now - then for now, then in zip(self[2:], before[2:])))


class Step(NamedTuple):
    """One step on the way: what came is gone on, counted, or unaccounted for."""

    name: str
    came: int
    went_on: int
    counted: int

    @property
    def unaccounted(self) -> int:
        return self.came - self.went_on - self.counted


def ledger(counts: Counts) -> tuple[Step, ...]:
    """Steps from SYNC to shape. Counts of CAN frames (unread, queue_overruns) hold heartbeats too: an upper bound.

    The driver gives a taxel frame for each SYNC that it has sent, also where no TPDO came: these are missing in it.
    TPDOs of at most one sweep of each pad wait for the end of its period (PadStatus.msg), at both ends of a session.
    A node counts the gaps that nodes before it have left in the sequence as well; they are taken off here.
    """
    sent, first, second = counts.tpdos * counts.sweeps, counts.processor, counts.classifier
    not_taken = min(max(sent - counts.received, 0), counts.unread + counts.queue_overruns)
    rest, waiting = counts.received - counts.used - counts.lost, counts.tpdos * counts.pads
    missed = min(max(counts.published - first.received, 0), first.skipped)
    missed_later = min(max(first.processed - second.received, 0), second.skipped)
    return (Step('TPDOs due -> used', counts.tpdos * counts.published, counts.used, counts.missing),
            Step('TPDO on the wire -> driver', sent, counts.received, not_taken),
            Step('TPDO in the driver -> taxel frame', counts.received, counts.used,
                 counts.lost + max(-waiting, min(rest, waiting))),
            Step('taxels published -> processor', counts.published, first.received, missed),
            Step('processor -> contact', first.received, first.processed, first.overtaken + first.dropped),
            Step('contact published -> classifier', first.processed, second.received, missed_later),
            Step('classifier -> shape', second.received, second.processed, second.overtaken + second.dropped))


class Exponent(NamedTuple):
    """Of y = c x^value, with its 95 % interval; NaN where there are too few points."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        if np.isnan(self.value):
            return 'not measured'
        return f'{self.value:.2f}' + ('' if np.isnan(self.low) else f' [{self.low:.2f}, {self.high:.2f}]')


def exponents(x: Sequence[Sequence[float]], y: Sequence[float]) -> tuple[Exponent, ...]:
    """Fit log y = log c + sum of b_i log x_i by least squares; (n, k) and (n,) -> the k exponents b_i.

    Interval by Student's t with n - k - 1 degrees of freedom. An exponent is NaN where its x has one value only;
    without any y there is none.

    >>> [str(each) for each in exponents([[1, 1], [2, 1], [4, 1], [1, 3], [2, 3]], [3, 6, 12, 27, 54])]
    ['1.00 [1.00, 1.00]', '2.00 [2.00, 2.00]']
    """
    if not len(y):
        return ()
    logs, target = np.log(np.asarray(x, float).reshape(len(y), -1)), np.log(np.asarray(y, float))
    varied = [column for column in range(logs.shape[1]) if np.ptp(logs[:, column])]
    found = [Exponent(np.nan, np.nan, np.nan)] * logs.shape[1]
    design = np.column_stack([np.ones(len(y)), logs[:, varied]])
    freedom = len(y) - design.shape[1]
    if not varied or freedom < 0 or np.linalg.matrix_rank(design) < design.shape[1]:
        return tuple(found)
    values = np.linalg.lstsq(design, target, rcond=None)[0]
    half = np.full(len(values), np.nan)
    if freedom:
        variance = np.sum((target - design @ values) ** 2) / freedom
        half = t.ppf(0.975, freedom) * np.sqrt(variance * np.diag(np.linalg.inv(design.T @ design)))
    for place, column in enumerate(varied, 1):
        found[column] = Exponent(*map(float, (values[place], values[place] - half[place], values[place] + half[place])))
    return tuple(found)
