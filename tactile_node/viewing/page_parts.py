"""Render the pads and the status line of the page from page.html. Data older than OLD_AGE are marked as old.
"""

import math
import time
from collections import deque
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tactile_node.colour_map import rounded_up
from tactile_node.taxel_frame import ON_OFF_UNIT, PRESS_BY_UNIT, TaxelStatus
from tactile_node.viewing.charts import POINT_COLOURS
from tactile_node.viewing.gate import TAKEN_PATH
from tactile_node.viewing.heat_map import heat_map, words
from tactile_node.viewing.source import Shown, ViewSource
from tactile_node.viewing.states import GraspFacts, PadState
from tactile_node.viewing.templates import environment

if TYPE_CHECKING:
    from tactile_node.viewing.bus_source import RecordingSource

OLD_AGE = 0.5          #: age at which data are first marked as old [s]
FRAME_TIME = 0.02      #: display time of one picture in the browser [s]
OLD_SCENE_AGE = 1.0    #: age above which the 3-D view is marked as old [s]
PAGE_SILENCE = 2.0  #: time without an update after which the page shows a warning [s]
HELD_SCALE = 10.0  #: time for which a peak reading keeps setting the colour scale [s]
CLOCK_DIFFERENCE_LIMIT = 5.0  #: difference between stamps and this computer's clock that triggers a warning [s]


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


def fresh_for(pads: list[DrawnPad]) -> float | None:
    """Return the time until which the browser may mark ``pads`` as live, or None if no pad is live.

    Returns
    -------
    float or None
        Time [s], counted from the moment at which the browser sent its last receipt. The server counts from the later
        arrival of the receipt, so old data are never marked as live, even if an update is delayed.
    """
    return min((_fresh_for(pad.age, pad.since_receipt) for pad in pads if pad.is_live), default=None)


def _fresh_for(age: float, since_receipt: float) -> float:
    return OLD_AGE - FRAME_TIME - age + since_receipt


class FullScale:
    """Computes the full scale, shown in the brightest colour, from the peak of the last HELD_SCALE seconds.

    The full scale never falls below the press threshold, so that noise stays dark.

    Parameters
    ----------
    unit
        Unit of the readings.
    fixed
        Fixed full scale, or None to compute it from the readings.
    """

    def __init__(self, unit: str, fixed: float | None = None):
        self._least = 1.0 if unit == ON_OFF_UNIT else PRESS_BY_UNIT[unit]
        self._fixed = fixed
        self._peaks: deque[tuple[float, float]] = deque()

    def update(self, values: np.ndarray, now: float) -> float:
        """Process the readings displayed at the time ``now`` [s], and return the full scale."""
        if self._fixed:
            return self._fixed
        peak = float(np.fmax.reduce(values, axis=None, initial=self._least))  # fmax ignores NaN
        while self._peaks and (self._peaks[-1][1] <= peak or self._peaks[-1][0] > now):
            self._peaks.pop()  # this peak can no longer become the largest
        self._peaks.append((now, peak))
        while now - self._peaks[0][0] > HELD_SCALE:
            self._peaks.popleft()
        return rounded_up(self._peaks[0][1])


class Scales:
    """Colour scales of all pads. ``fixed`` sets the same full scale for every pad."""

    def __init__(self, fixed: float | None = None):
        self._fixed = fixed
        # The key contains pad name and unit, because a new layout may change the unit.
        self._scales: dict[tuple[str, str], FullScale] = {}

    def drawn_now(self, source: ViewSource, shown: Shown) -> list[DrawnPad]:
        return [self.drawn(name, state, math.inf if state is None else source.age(state))
                for name, state in shown.pads.items()]

    def drawn(self, name: str, state: PadState | None, age: float) -> DrawnPad:
        if state is None:
            return DrawnPad(name, None, math.inf, 1.0)
        scale = self._scales.setdefault((name, state.unit), FullScale(state.unit, self._fixed))
        return DrawnPad(name, state, age, scale.update(state.values, state.stamp))


@cache
def macros() -> Any:
    """Return the macros of page.html."""
    return environment().get_template('page.html', globals={
        'page_silence': PAGE_SILENCE, 'old': OLD_AGE, 'old_scene': OLD_SCENE_AGE, 'taken': TAKEN_PATH,
        'point_colours': POINT_COLOURS, 'said_of': said_of, 'hidden_text': hidden_text, 'words': words,
        'heat_map': heat_map, 'fresh_for': fresh_for, 'silence': silence}).module


def pads_html(pads: list[DrawnPad], number: int, is_recording: bool = False) -> str:
    """Return all pads as HTML. ``number`` makes each update different from the previous one."""
    return str(macros().pads(pads, number, is_recording))


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


def hidden_text(state: PadState) -> str:
    hidden = int((~(state.values == state.values) & (state.status != TaxelStatus.UNMAPPED)).sum())
    return f'{hidden} of {state.values.size} taxels without a value' if hidden else ''


class PageFacts(NamedTuple):
    """Facts about the source, and how well the browser keeps up with it."""

    title: str
    player: 'RecordingSource | None'  #: player of a recording, or None for live data
    problem: str
    rate: float       #: rate of updates confirmed by this browser [1/s]
    delay: float      #: mean age of the newest data on arrival in the browser [s], or NaN if not measured yet
    scene_age: float  #: age of the last 3-D view that the browser has confirmed [s], or inf if there is none
    grasp: GraspFacts | None = None


def clock_difference(pads: list[DrawnPad], wall: float) -> float:
    """Return how far the stamps lag behind this computer's clock ``wall`` [s], or NaN if all data are old."""
    return max((wall - pad.age - pad.state.stamp for pad in pads if pad.state is not None and pad.is_live),
               key=abs, default=math.nan)


def _other_clock(behind: float) -> str:
    """Return a warning if the stamps are far from this computer's clock, as in a replay that keeps the log's stamps."""
    if not abs(behind) > CLOCK_DIFFERENCE_LIMIT:
        return ''
    return (f'; the stamps are {abs(behind):.0f} s {"before" if behind > 0 else "after"} the time of this computer, '
            'because this is a replay or the clocks differ')


def status_html(facts: PageFacts, pads: list[DrawnPad], page: int, number: int) -> str:
    """Return the status line of the page as HTML, with the receipt for update ``number`` of ``page``."""
    fresh = None if facts.player is not None else fresh_for(pads)
    grasp_age = math.nan if facts.grasp is None else time.monotonic() - facts.grasp.acquired
    grasp_fresh = _fresh_for(grasp_age, max((pad.since_receipt for pad in pads), default=0.0))
    return str(macros().status(facts, pads, page, number, fresh, grasp_age, grasp_fresh,
                               _other_clock(clock_difference(pads, time.time()))))
