"""Parts of the page as HTML, from the template page.html: the pads and the state of the data. Old data are marked."""

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

OLD_AGE = 0.5          #: age from which data are marked as old [s]
FRAME_TIME = 0.02      #: time for which a painted picture stays on the screen of a browser [s]
OLD_SCENE_AGE = 1.0    #: age up to which the 3-D view is marked as current [s]
PAGE_SILENCE = 2.0  #: time without an update after which the page reports this [s]
HELD_SCALE = 10.0  #: time for which the largest reading sets the colour scale [s]
CLOCK_DIFFERENCE_LIMIT = 5.0  #: difference between stamps and this computer's clock above which it is reported [s]


class DrawnPad(NamedTuple):
    """A pad as it is drawn now."""

    name: str
    state: PadState | None
    age: float         #: age of the state [s]; inf if not known
    full_scale: float  #: reading with the brightest colour, in the unit of the pad
    since_receipt: float = 0.0  #: time since the receipt of the previous update [s]

    @property
    def is_old(self) -> bool:
        return not self.age <= OLD_AGE

    @property
    def is_live(self) -> bool:
        """True if the state is new and has valid taxels. The frames of a dead skin have none."""
        return self.state is not None and not self.is_old and not np.isnan(self.state.values).all()


def fresh_for(pads: list[DrawnPad]) -> float | None:
    """Return how long the browser may show these data as live, or None if no pad is live.

    Returns
    -------
    float or None
        Time after the browser sent its last receipt [s]. The receipt arrives later than it was sent, so data never
        count as younger than they are, however long an update takes on its way.
    """
    return min((_fresh_for(pad.age, pad.since_receipt) for pad in pads if pad.is_live), default=None)


def _fresh_for(age: float, since_receipt: float) -> float:
    return OLD_AGE - FRAME_TIME - age + since_receipt


class FullScale:
    """Computes the reading with the brightest colour: the largest of the last HELD_SCALE seconds, rounded up.

    It is never below the press threshold, so that noise stays dark.

    Parameters
    ----------
    unit
        Unit of the readings.
    fixed
        Reading to use instead, or None.
    """

    def __init__(self, unit: str, fixed: float | None = None):
        self._least = 1.0 if unit == ON_OFF_UNIT else PRESS_BY_UNIT[unit]
        self._fixed = fixed
        self._peaks: deque[tuple[float, float]] = deque()

    def update(self, values: np.ndarray, now: float) -> float:
        """Process a frame that is shown at the time ``now`` [s], and return the reading with the brightest colour."""
        if self._fixed:
            return self._fixed
        peak = float(np.fmax.reduce(values, axis=None, initial=self._least))  # fmax ignores NaN
        while self._peaks and (self._peaks[-1][1] <= peak or self._peaks[-1][0] > now):
            self._peaks.pop()  # because it can never become the largest again
        self._peaks.append((now, peak))
        while now - self._peaks[0][0] > HELD_SCALE:
            self._peaks.popleft()
        return rounded_up(self._peaks[0][1])


class Scales:
    """The colour scale of each pad; ``fixed`` is the reading with the brightest colour for all pads."""

    def __init__(self, fixed: float | None = None):
        self._fixed = fixed
        self._scales: dict[tuple[str, str], FullScale] = {}  # by name and unit: a new layout may change the unit

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
    """Return all pads as HTML; ``number`` makes each update differ from the last one."""
    return str(macros().pads(pads, number, is_recording))


def said_of(pad: DrawnPad) -> str:
    """Return text that says whether the data of a pad are live."""
    if pad.state is None:
        return 'no data received yet'
    fresh = f'LIVE, {1e3 * pad.age:.0f} ms old' if pad.is_live else 'no valid taxels'
    return silence(pad.age) if pad.is_old else fresh


def silence(age: float) -> str:
    """Return text that says for how long no data were received.

    >>> silence(3.21), silence(math.inf)
    ('no data for 3.2 s', 'age of the data not known')
    """
    return f'no data for {age:.1f} s' if math.isfinite(age) else 'age of the data not known'


def hidden_text(state: PadState) -> str:
    hidden = int((~(state.values == state.values) & (state.status != TaxelStatus.UNMAPPED)).sum())
    return f'{hidden} of {state.values.size} taxels without a value' if hidden else ''


class PageFacts(NamedTuple):
    """Facts about the source, and about how fast the browser follows."""

    title: str
    player: 'RecordingSource | None'  #: player of a recording; None for live data
    problem: str
    rate: float       #: updates that this browser has confirmed [1/s]
    delay: float      #: age of the newest data when the browser had received them [s]; NaN if not measured yet
    scene_age: float  #: age of the 3-D view by the browser's receipt [s]; inf if it shows nothing yet
    grasp: GraspFacts | None = None


def clock_difference(pads: list[DrawnPad], wall: float) -> float:
    """Return how far the stamps are behind ``wall``, the clock of this computer [s]; NaN if all data are old."""
    return max((wall - pad.age - pad.state.stamp for pad in pads if pad.state is not None and pad.is_live),
               key=abs, default=math.nan)


def _other_clock(behind: float) -> str:
    """Return a warning if the stamps are far from this computer's clock, as in a replay with the stamps of its log."""
    if not abs(behind) > CLOCK_DIFFERENCE_LIMIT:
        return ''
    return (f'; the stamps are {abs(behind):.0f} s {"before" if behind > 0 else "after"} the time of this computer: it '
            'is a replay, or the clocks differ')


def status_html(facts: PageFacts, pads: list[DrawnPad], page: int, number: int) -> str:
    """Return the line that says whether the page is live, and the receipt of update ``number`` of ``page``."""
    fresh = None if facts.player is not None else fresh_for(pads)
    grasp_age = math.nan if facts.grasp is None else time.monotonic() - facts.grasp.acquired
    grasp_fresh = _fresh_for(grasp_age, max((pad.since_receipt for pad in pads), default=0.0))
    return str(macros().status(facts, pads, page, number, fresh, grasp_age, grasp_fresh,
                               _other_clock(clock_difference(pads, time.time()))))
