"""A pad with the data needed to draw it. Data older than OLD_AGE are marked as old."""

import math
from typing import NamedTuple

import numpy as np

from tactile_node.colour_map import ColourScale
from tactile_node.viewing.source import ViewSource, ViewState
from tactile_node.viewing.states import PadState

OLD_AGE = 0.5          #: age at which data are first marked as old [s]


class DrawnPad(NamedTuple):
    """A pad with the data needed to draw it."""

    name: str
    state: PadState | None
    age: float         #: age of the state [s], or inf if unknown
    full_scale: float  #: reading shown in the brightest colour, in the unit of the pad
    since_receipt: float = 0.0  #: time since the receipt of the previous update [s]

    @property
    def is_old(self) -> bool:
        return not self.age <= OLD_AGE

    @property
    def is_live(self) -> bool:
        """True if the state is recent and has valid taxels. The frames of a dead skin have no valid taxels."""
        return self.state is not None and not self.is_old and not np.isnan(self.state.values).all()


def said_of(pad: DrawnPad) -> str:
    """Describe in words whether the data of a pad are live."""
    if pad.state is None:
        return 'no data received yet'
    fresh = f'LIVE, {1e3 * pad.age:.0f} ms old' if pad.is_live else 'no valid taxels'
    return silence(pad.age) if pad.is_old else fresh


def silence(age: float) -> str:
    """Describe in words how long it has been since data were received.

    >>> silence(3.21), silence(math.inf)
    ('no data for 3.2 s', 'age of the data not known')
    """
    return f'no data for {age:.1f} s' if math.isfinite(age) else 'age of the data not known'


class Scales:
    """Colour scales of all pads. ``fixed`` sets the same full scale for every pad, unless it is 0."""

    def __init__(self, fixed: float = 0.0):
        self._fixed = fixed
        # by pad name and unit, because a new layout may change the unit
        self._scales: dict[tuple[str, str], ColourScale] = {}

    def drawn_now(self, source: ViewSource, shown: ViewState) -> list[DrawnPad]:
        return [self.drawn(name, state, math.inf if state is None else source.age(state))
                for name, state in shown.pads.items()]

    def drawn(self, name: str, state: PadState | None, age: float) -> DrawnPad:
        if state is None:
            return DrawnPad(name, None, math.inf, 1.0)
        scale = self._scales.setdefault((name, state.unit), ColourScale(self._fixed))
        return DrawnPad(name, state, age, scale.full_scale(state.values, state.unit, state.stamp))
