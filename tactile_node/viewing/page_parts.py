"""The parts of the page as HTML, by the template page.html: pads, state of the data. What is old looks old."""

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

OLD_AGE = 0.5          #: age from which on data are marked as old [s]
FRAME_TIME = 0.02      #: for which a browser leaves on the screen what it has painted [s]
OLD_SCENE_AGE = 1.0    #: age up to which the 3-D view is marked as current [s]
PAGE_SILENCE = 2.0  #: for which a page may get nothing before it says so [s]
HELD_SCALE = 10.0  #: for which the largest reading sets the scale [s]
CLOCK_DIFFERENCE_LIMIT = 5.0  #: from this difference of stamps and this computer on, the page reports two clocks [s]


class DrawnPad(NamedTuple):
    """A pad as it is drawn now."""

    name: str
    state: PadState | None
    age: float         #: [s]; inf: not known
    full_scale: float  #: [unit]
    since_receipt: float = 0.0  #: how long ago the receipt of the update before had come [s]

    @property
    def is_old(self) -> bool:
        return not self.age <= OLD_AGE

    @property
    def is_live(self) -> bool:
        """New, with valid taxels: the frames of a dead skin have none."""
        return self.state is not None and not self.is_old and not np.isnan(self.state.values).all()


def fresh_for(pads: list[DrawnPad]) -> float | None:
    """Return for how long after its last receipt the browser may show as live what is sent now [s]; None: nothing is.

    The receipt came later than it left, so that nothing is counted too young, whatever the way takes.
    """
    return min((_fresh_for(pad.age, pad.since_receipt) for pad in pads if pad.is_live), default=None)


def _fresh_for(age: float, since_receipt: float) -> float:
    return OLD_AGE - FRAME_TIME - age + since_receipt


class FullScale:
    """The reading that has the brightest colour: the largest of the last HELD_SCALE seconds, rounded up.

    ``fixed``: that reading instead. It is never less than from which on a taxel is pressed, so that noise stays dark.
    """

    def __init__(self, unit: str, fixed: float | None = None):
        self._least = 1.0 if unit == ON_OFF_UNIT else PRESS_BY_UNIT[unit]
        self._fixed = fixed
        self._peaks: deque[tuple[float, float]] = deque()

    def update(self, values: np.ndarray, now: float) -> float:
        """Take a frame, shown at ``now`` [s], and return the scale."""
        if self._fixed:
            return self._fixed
        peak = float(np.fmax.reduce(values, axis=None, initial=self._least))  # fmax leaves NaN out
        while self._peaks and (self._peaks[-1][1] <= peak or self._peaks[-1][0] > now):
            self._peaks.pop()  # it can never be the largest again
        self._peaks.append((now, peak))
        while now - self._peaks[0][0] > HELD_SCALE:
            self._peaks.popleft()
        return rounded_up(self._peaks[0][1])


class Scales:
    """The colour scale of each pad; ``fixed``: the reading of the brightest colour."""

    def __init__(self, fixed: float | None = None):
        self._fixed = fixed
        self._scales: dict[tuple[str, str], FullScale] = {}  # by name and unit: a driver may start with another layout

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
    """Return all pads; ``number`` makes each update another one."""
    return str(macros().pads(pads, number, is_recording))


def said_of(pad: DrawnPad) -> str:
    """Return what the data of a pad are worth now."""
    if pad.state is None:
        return 'no data has come'
    fresh = f'LIVE, {1e3 * pad.age:.0f} ms old' if pad.is_live else 'no valid taxels'
    return silence(pad.age) if pad.is_old else fresh


def silence(age: float) -> str:
    """Return that nothing new comes.

    >>> silence(3.21), silence(math.inf)
    ('no data for 3.2 s', 'age of the data not known')
    """
    return f'no data for {age:.1f} s' if math.isfinite(age) else 'age of the data not known'


def hidden_text(state: PadState) -> str:
    hidden = int((~(state.values == state.values) & (state.status != TaxelStatus.UNMAPPED)).sum())
    return f'{hidden} of {state.values.size} taxels without a value' if hidden else ''


class PageFacts(NamedTuple):
    """What the page reports of its source and of its pace."""

    title: str
    player: 'RecordingSource | None'  #: of a recording; None: live
    problem: str
    rate: float       #: updates that this browser has taken [1/s]
    delay: float      #: age of the newest data when the browser had them [s]; NaN: not measured yet
    scene_age: float  #: of what the 3-D view shows, by the browser's receipt [s]; inf: it shows nothing yet
    grasp: GraspFacts | None = None


def clock_difference(pads: list[DrawnPad], wall: float) -> float:
    """Return by how much the stamps are behind ``wall``, the clock of this computer [s]; NaN: all is old."""
    return max((wall - pad.age - pad.state.stamp for pad in pads if pad.state is not None and pad.is_live),
               key=abs, default=math.nan)


def _other_clock(behind: float) -> str:
    """What comes now may have been recorded long ago: a replay publishes the stamps of its log."""
    if not abs(behind) > CLOCK_DIFFERENCE_LIMIT:
        return ''
    return (f'; by its stamps {abs(behind):.0f} s {"before" if behind > 0 else "after"} the time of this computer: a '
            'replay, or the clocks differ')


def status_html(facts: PageFacts, pads: list[DrawnPad], page: int, number: int) -> str:
    """Return the line that says whether this is live, and the receipt of update ``number`` of ``page``."""
    fresh = None if facts.player is not None else fresh_for(pads)
    grasp_age = math.nan if facts.grasp is None else time.monotonic() - facts.grasp.acquired
    grasp_fresh = _fresh_for(grasp_age, max((pad.since_receipt for pad in pads), default=0.0))
    return str(macros().status(facts, pads, page, number, fresh, grasp_age, grasp_fresh,
                               _other_clock(clock_difference(pads, time.time()))))
