"""The parts of the page as HTML: pads, state of the data, style. What is old looks old."""

import math
import time
from html import escape
from typing import NamedTuple

import numpy as np

from tactile_node.taxel_frame import TaxelStatus
from tactile_node.viewing.colours import FullScale
from tactile_node.viewing.gate import TAKEN
from tactile_node.viewing.heat_map import heat_map, words
from tactile_node.viewing.pads_3d import POINTS
from tactile_node.viewing.source import Player, Shown, Source
from tactile_node.viewing.states import GraspFacts, PadState

OLD = 0.5          #: age from which on data are marked as old [s]
OLD_SCENE = 1.0    #: age up to which the 3-D view is marked as current [s]
PAGE_SILENT = 2.0  #: for which a page may get nothing before it says so [s]
CLOCKS_APART = 5.0  #: from this difference of stamps and this computer on, the page reports two clocks [s]
BARS = 4           #: most probable classes that are shown

#: The last rules run in the browser alone: each update replaces the element, which begins the wait again. So the page
#: says that it is not live also where the server is gone, the network is down or this computer is too slow.
STYLE = f'''<style>
.tactile-pads {{display:flex; flex-wrap:wrap; gap:8px; padding:4px 10px; font-size:13px}}
.tactile-pad {{flex:1 1 260px; min-width:0; position:relative}}
.tactile-pad h3 {{margin:0; font-size:15px; display:flex; gap:6px}}
.tactile-pad h3 small {{font-weight:400; opacity:.7; margin-left:auto}}
.tactile-words {{min-height:2.7em; font-weight:600}}
.tactile-map {{width:100%; display:block}}
.tactile-silent {{position:absolute; left:0; right:0; top:35%; text-align:center; font-weight:700; font-size:18px;
  color:#c81e1e; background:#fffd; padding:6px; border:2px solid #c81e1e}}
.tactile-bar {{display:grid; grid-template-columns:9.5em 1fr 3.2em; gap:6px; align-items:center; font-size:12px}}
.tactile-bar i {{display:block; height:9px; background:#0ea5e9; border-radius:2px}}
.tactile-status {{padding:4px 10px; font-size:13px; position:relative}}
b.tactile-live {{color:#15803d}} b.tactile-old {{color:#c81e1e}} b.tactile-rec {{color:#b45309}}
.tactile-note {{padding:2px 10px; font-size:12px}} .tactile-force {{padding:2px 10px}}
.tactile-taken {{position:absolute; width:0; height:0}}
.tactile-problem {{color:#c81e1e; font-weight:600}}
.tactile-health {{font-size:12px; margin:2px 10px; border-spacing:6px 1px}}
.tactile-health td {{vertical-align:top}} .tactile-health .bad td {{color:#c81e1e; font-weight:600}}
.tactile-planes {{padding:2px 10px}}
.tactile-dead {{position:absolute; inset:0; z-index:5; display:flex; align-items:center; justify-content:center;
  text-align:center; font-weight:700; font-size:18px; color:#c81e1e; background:#fffe; border:2px solid #c81e1e;
  pointer-events:none; opacity:0; animation:tactile-dead 0s linear {PAGE_SILENT}s forwards}}
@keyframes tactile-dead {{to {{opacity:1}}}}
.tactile-fresh {{animation:tactile-gone 0s linear {PAGE_SILENT}s forwards}}
@keyframes tactile-gone {{to {{visibility:hidden}}}}
.tactile-status .tactile-dead {{position:fixed}}
body:not(:has(.tactile-scene-current)) div:has(> canvas ~ div, > div ~ canvas)::after {{
  content:'OLD: the 3-D view is off, or this browser draws it late'; position:absolute; inset:0; z-index:2;
  display:grid; place-items:center; padding:20px; text-align:center; font-weight:700; color:#c81e1e; background:#fffd}}
</style>'''
LEGEND = ('<div class="tactile-note">Force of the largest contact. In the maps: grey with a cross, no valid value; '
          'green ring, saturated: a lower bound; cyan, the fitted outline.</div>')
DEAD = f'<div class="tactile-dead">NOT LIVE: this page has got nothing for {PAGE_SILENT:g} s or more</div>'


class DrawnPad(NamedTuple):
    """A pad as it is drawn now."""

    name: str
    state: PadState | None
    age: float         #: [s]; inf: not known
    full_scale: float  #: [unit]
    transit: float = 0.0  #: that the browser took for the update before [s]

    @property
    def is_old(self) -> bool:
        return not self.age <= OLD

    @property
    def is_live(self) -> bool:
        """New, with valid taxels: the frames of a dead skin have none."""
        return self.state is not None and not self.is_old and not np.isnan(self.state.values).all()


def fresh_for(pads: list[DrawnPad]) -> float:
    """Return for how long what is sent now may look live once the browser has it [s]: the browser counts alone."""
    return min((max(OLD - pad.age - pad.transit, 0.0) for pad in pads if pad.is_live), default=PAGE_SILENT)


class Scales:
    """The colour scale of each pad; ``fixed``: the reading of the brightest colour."""

    def __init__(self, fixed: float | None = None):
        self._fixed = fixed
        self._scales: dict[tuple[str, str], FullScale] = {}  # by name and unit: a driver may start with another layout

    def drawn_now(self, source: Source, shown: Shown) -> list[DrawnPad]:
        return [self.drawn(name, state, math.inf if state is None else source.age(state))
                for name, state in shown.pads.items()]

    def drawn(self, name: str, state: PadState | None, age: float) -> DrawnPad:
        if state is None:
            return DrawnPad(name, None, math.inf, 1.0)
        scale = self._scales.setdefault((name, state.unit), FullScale(state.unit, self._fixed))
        return DrawnPad(name, state, age, scale.update(state.values, state.stamp))


def pads_html(pads: list[DrawnPad], number: int, is_recording: bool = False) -> str:
    """Return all pads; ``number`` makes each update another one."""
    drawn = ''.join(_pad(pad, POINTS[k % len(POINTS)], is_recording) for k, pad in enumerate(pads))
    return f'<div class="tactile-pads" data-update="{number}">{drawn}</div>'


def _pad(pad: DrawnPad, colour: str, is_recording: bool) -> str:
    """``colour``: of its line in the chart and its point in the planes."""
    word = '' if is_recording else _word(pad.is_live)
    name = f'<span><span style="color:{colour}">&#9679;</span> {escape(pad.name)}</span>{word}'
    if pad.state is None:
        return f'<div class="tactile-pad"><h3>{name}</h3><div class="tactile-words">{said_of(pad)}</div>{DEAD}</div>'
    contact, is_live = pad.state.contact, pad.is_live
    said = escape(words(contact)) if is_live else 'what touches is not known'
    bars = _bars(contact.probabilities) if is_live and contact is not None else ''
    silent = '' if is_live else f'<div class="tactile-silent">{said_of(pad)}</div>'
    dead = DEAD if is_recording or not is_live else (
        f'<div class="tactile-dead" style="animation-delay:{fresh_for([pad]):.3f}s">NOT LIVE: this page has got '
        f'nothing newer than {OLD:g} s</div>')
    return (f'<div class="tactile-pad"><h3>{name}<small>{_hidden(pad.state)}</small></h3>'
            f'<div class="tactile-words">{said}</div>{heat_map(pad.state, pad.full_scale, not is_live)}{bars}{silent}'
            f'{dead}</div>')


def _word(is_live: bool) -> str:
    return '<b class="tactile-live">LIVE</b>' if is_live else '<b class="tactile-old">NOT LIVE</b>'


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


def _hidden(state: PadState) -> str:
    hidden = int((~(state.values == state.values) & (state.status != TaxelStatus.UNMAPPED)).sum())
    return f'{hidden} of {state.values.size} taxels without a value' if hidden else ''


def _bars(probabilities) -> str:
    best = sorted(probabilities.items(), key=lambda item: -item[1])[:BARS]
    return ''.join(f'<div class="tactile-bar"><span>{escape(name.replace("_", " "))}</span>'
                   f'<i style="width:{100 * value:.0f}%"></i><span>{100 * value:.0f} %</span></div>'
                   for name, value in best)


class PageFacts(NamedTuple):
    """What the page reports of its source and of its pace."""

    title: str
    player: Player | None  #: of a recording; None: live
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
    if not abs(behind) > CLOCKS_APART:
        return ''
    return (f'; by its stamps {abs(behind):.0f} s {"before" if behind > 0 else "after"} the time of this computer: a '
            'replay, or the clocks differ')


def grasp_html(grasp: GraspFacts | None) -> str:
    """Return the state of the grasp, while it is known what it is now."""
    if grasp is None:
        return 'grasp: none comes from this source'
    age, contact = time.monotonic() - grasp.acquired, grasp.contact.replace('_', ' ')
    if not age <= OLD:
        reason = silence(age)
    elif not grasp.is_fresh or grasp.contact in ('not_known', 'unseen'):
        reason = contact if grasp.is_fresh else 'not fresh'
    else:
        return (f'grasp: <b class="tactile-live">{contact}, {"" if grasp.is_stable else "not "}stable, fresh</b>, '
                f'{1e3 * age:.0f} ms old')
    return f'grasp: <b class="tactile-old">NOT KNOWN</b>, {reason}'


def status_html(facts: PageFacts, pads: list[DrawnPad], page: int, number: int) -> str:
    """Return the line that says whether this is live, and the receipt of update ``number`` of ``page``."""
    if facts.player is not None:
        word = f'<b class="tactile-rec">RECORDING, {"playing" if facts.player.is_playing else "paused"}</b>'
        text = (f'{facts.player.position:.1f} of {facts.player.length:.1f} s; shapes are recognised again from its '
                'taxels')
    else:
        word = _word(bool(pads) and all(pad.is_live for pad in pads))
        text = '; '.join(f'{escape(pad.name)}: {said_of(pad)}' for pad in pads)
        text += _other_clock(clock_difference(pads, time.time()))
    delay = '' if math.isnan(facts.delay) else f', shown after {1e3 * facts.delay:.0f} ms'
    scene = '<i class="tactile-scene-current"></i>' if facts.scene_age <= OLD_SCENE else ''
    problem = f'<div class="tactile-problem">{escape(facts.problem)}</div>' if facts.problem else ''
    fresh = PAGE_SILENT if facts.player is not None else fresh_for(pads)
    return (f'<div class="tactile-status" data-update="{number}" data-rate="{facts.rate:.1f}" '
            f'data-delay="{facts.delay:.3f}"><div class="tactile-fresh" style="animation-delay:{fresh:.3f}s">{word} '
            f'{escape(facts.title)}<br>{text}<br>{grasp_html(facts.grasp)}</div>'
            f'{facts.rate:.0f} updates/s{delay}{scene}{problem}{DEAD}{receipt_html(page, number)}</div>')


def receipt_html(page: int, number: int) -> str:
    """Return the picture for which a browser asks when it has put update ``number`` on ``page``."""
    return f'<img class="tactile-taken" alt="" src="{TAKEN}/{page}/{number}">'
