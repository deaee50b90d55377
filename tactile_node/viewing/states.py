"""State of a pad and of the grasp at one moment, in a form common to all sources."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tactile_node.pose.events import EventKind, Moving
from tactile_node.taxel_frame import TaxelStatus


class SeenContact(NamedTuple):
    """The largest contact and its recognised shape. If the pad is seen and empty, `shape` is 'none'."""

    shape: str          #: name of the shape class, as published on the topics
    reason: str         #: reason why the shape is unknown, or '' if it is known
    probabilities: Mapping[str, float]
    outline: np.ndarray | None            #: corners (n, 2) in the pad frame [m], or None without a shape
    dimensions: tuple[tuple[str, float], ...]  #: names and lengths of the dimensions [m]
    size_is_bound: bool                   #: True if the dimensions are lower bounds
    force: float                          #: force of the contact [N], or NaN if unknown
    mask: np.ndarray | None               #: mask of the contact's taxels, bool (rows, cols), or None if unknown
    force_is_bound: bool = False          #: True if the force is a lower bound, because taxels are saturated or hidden
    moves: str = ''                       #: motion and last event as text from `moving_words`

    @property
    def confidence(self) -> float:
        """Probability of ``shape``."""
        return self.probabilities.get(self.shape, 0.0)


SAID_FOR = 3.0  #: time for which an event is shown [s]


def moving_words(moving: int, speed: float, rate: float, event: int, age: float) -> str:
    """Return the motion and the last event of a contact as text, or '' if there is nothing to report.

    Parameters
    ----------
    moving
        Sum of `Moving` flags.
    speed
        Speed of the shift or slide [m/s].
    rate
        Rate of turning [rad/s].
    event
        Last event as an `EventKind`, or 0 if there is none.
    age
        Age of the event [s].

    Examples
    --------

    >>> moving_words(Moving.SLIDING, 0.0123, math.nan, EventKind.SLIDING, 0.44)
    'sliding 12.3 mm/s, event: sliding 0.4 s ago'
    """
    said = [f'{word} {1e3 * speed:.1f} mm/s' for word, flag in (('shifting', Moving.SHIFTING),
                                                                ('sliding', Moving.SLIDING)) if moving & flag]
    said += [f'turning {math.degrees(rate):.0f} deg/s'] if moving & Moving.TURNING else []
    said += [f'event: {EventKind(event).name.lower()} {age:.1f} s ago'] if event and age < SAID_FOR else []
    return ', '.join(said)


class PadState(NamedTuple):
    """One taxel frame of a pad and the contact recognised in it. The arrays are read-only."""

    pad: str
    stamp: float         #: acquisition time [s, Unix epoch]
    acquired: float      #: acquisition time by time.monotonic [s], or the display time for a recording
    values: np.ndarray   #: taxel values, float (rows, cols), NaN where there is no valid value
    status: np.ndarray   #: `TaxelStatus` of each taxel, uint8 (rows, cols)
    pitch: float         #: [m]
    unit: str            #: unit of the values: 'Pa', 'N' or '1'
    contact: SeenContact | None = None  #: recognised contact, or None if the source does not recognise contacts

    @property
    def hidden(self) -> np.ndarray:
        """Mask of the taxels without a valid value, without the places where there is no taxel."""
        return np.isnan(self.values) & (self.status != TaxelStatus.UNMAPPED)


class GraspFacts(NamedTuple):
    """The grasp between two pads."""

    contact: str     #: name of a GraspContact, in lower case
    is_fresh: bool   #: True if the results of both pads are recent
    is_stable: bool
    acquired: float      #: acquisition time of the older pad's data by time.monotonic [s], or -inf if unknown
