"""Render the pads and the status line of the page from page.html."""

import math
import time
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from tactile_node.viewing.chart import POINT_COLOURS
from tactile_node.viewing.contact_text import contact_text
from tactile_node.viewing.drawn_pad import OLD_AGE, DrawnPad, said_of, silence
from tactile_node.viewing.gate import TAKEN_PATH
from tactile_node.viewing.pad_picture import pad_picture
from tactile_node.viewing.states import GraspFacts, PadState
from tactile_node.viewing.templates import environment

if TYPE_CHECKING:
    from tactile_node.viewing.recording_source import RecordingSource

FRAME_TIME = 0.02  #: margin for the time that the browser needs to show a picture [s]
PAGE_SILENCE = 2.0  #: time without an update after which the page shows a warning [s]
CLOCK_DIFFERENCE_LIMIT = 5.0  #: difference between stamps and this computer's clock that triggers a warning [s]


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


@cache
def macros() -> Any:
    """Return the macros of page.html."""
    return environment().get_template('page.html', globals={
        'page_silence': PAGE_SILENCE, 'old': OLD_AGE, 'taken': TAKEN_PATH,
        'point_colours': POINT_COLOURS, 'said_of': said_of, 'hidden_text': hidden_text, 'contact_text': contact_text,
        'pad_picture': pad_picture, 'fresh_for': fresh_for, 'silence': silence}).module


def pads_html(pads: list[DrawnPad], number: int, is_recording: bool = False) -> str:
    """Return all pads as HTML. ``number`` makes each update different from the previous one."""
    return str(macros().pads(pads, number, is_recording))


def hidden_text(state: PadState) -> str:
    hidden = int(state.hidden.sum())
    return f'{hidden} of {state.values.size} taxels without a value' if hidden else ''


class PageFacts(NamedTuple):
    """Facts about the source, and how well the browser keeps up with it."""

    title: str
    player: 'RecordingSource | None'  #: player of a recording, or None for live data
    problem: str
    rate: float       #: rate of updates confirmed by this browser [1/s]
    delay: float      #: mean age of the newest data on arrival in the browser [s], or NaN if not measured yet
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
