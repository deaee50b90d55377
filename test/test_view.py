"""The viewer must not present old, hidden or unknown data to its user as a measurement."""

import base64
import io
import re
import time
from dataclasses import dataclass, replace
from itertools import count
from threading import Event
from types import SimpleNamespace
from unittest.mock import MagicMock
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from viewed import NAN, HandSource, contact, state
from waiting import until

from tactile_node.assembly.facts import BusFacts, LossReason, NodeFacts, PadFacts, losses_in, pad_counts
from tactile_node.assembly.facts_history import FactsHistory
from tactile_node.assembly.health import BusFault, Failure, NodeFault
from tactile_node.cia301.objects import NmtState
from tactile_node.colour_map import PALETTE, levels
from tactile_node.shape.methods import make_recogniser
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus
from tactile_node.viewing.contact_text import contact_text
from tactile_node.viewing.counts_table import RECENT_TIME, counts_table
from tactile_node.viewing.drawn_pad import OLD_AGE, Scales
from tactile_node.viewing.pad_picture import pad_picture
from tactile_node.viewing.pad_recogniser import PadRecogniser
from tactile_node.viewing.page import force_chart
from tactile_node.viewing.page_parts import (
    FRAME_TIME,
    PageFacts,
    clock_difference,
    fresh_for,
    macros,
    pads_html,
    status_html,
)
from tactile_node.viewing.source import MOST_FORCE_POINTS, Store
from tactile_node.viewing.states import GraspFacts
from tactile_node.viewing.terminal import show_in_terminal
from tactile_node.viewing.timeline import Timeline

pytest.importorskip('jinja2')
LIVE = PageFacts('by hand', None, '', 20.0, 0.05)


def parts(svg, tag):
    return [element for element in fromstring(svg).iter() if element.tag == tag]


def pixels(svg):
    """Return the colours of the taxels in a picture, row 0 first, as the library Pillow reads them."""
    image = pytest.importorskip('PIL.Image')
    address = parts(svg, 'image')[0].get('href')
    content = base64.b64decode(address.removeprefix('data:image/png;base64,'))
    return np.asarray(image.open(io.BytesIO(content)).convert('RGBA'))[::-1]


def drawn(age, **changed):
    return Scales().drawn('left', state(**changed), age)


class Terminal(io.StringIO):
    def isatty(self):
        return True


# --- The store


def test_unread_states_are_replaced_and_the_history_is_bounded():
    store = Store(['left'])
    for k in range(5 * MOST_FORCE_POINTS):
        store.put(state(stamp=0.001 * k))
    assert store.shown().pads['left'].stamp == pytest.approx(0.001 * (5 * MOST_FORCE_POINTS - 1))
    assert store.forces('left').shape == (2, MOST_FORCE_POINTS)


def test_a_pad_that_a_recording_has_not_reached_is_not_shown():
    store = Store(['left'])
    store.put(state())
    store.forget('left')
    assert store.shown().pads['left'] is None and store.forces('left').shape == (2, 0)


def test_going_back_in_a_recording_begins_the_force_again():
    store = Store(['left'])
    for stamp in (10.0, 10.1, 3.0):
        store.put(state(stamp=stamp))
    assert store.forces('left')[0].tolist() == [3.0]


# --- Pictures


def test_a_taxel_without_a_value_is_marked_and_not_the_colour_of_no_load():
    values = np.full((4, 4), 50e3)
    values[:, :2] = NAN  # Half of the pad is hidden.
    svg = pad_picture(state(values=values), 100e3)
    crosses = next(path for path in parts(svg, 'path') if path.get('class') == 'no-value')
    assert crosses.get('d').count('M') == 8
    colours = pixels(svg)[:, :2].reshape(-1, 4)
    assert len(colours) == 8 and not {tuple(colour[:3]) for colour in colours} & {tuple(colour) for colour in PALETTE}
    assert '8 of 16 taxels without a value' in pads_html([drawn(0.1, values=values)], 1)


def test_a_picture_has_row_0_at_the_bottom_and_nothing_where_there_is_no_taxel():
    values, status = np.zeros((2, 3)), np.full((2, 3), TaxelStatus.VALID, np.uint8)
    values[0, 2], values[1, 0], status[1, 0] = 100e3, NAN, TaxelStatus.UNMAPPED
    found = pixels(pad_picture(state(values=values, status=status), 100e3))
    assert found.shape == (2, 3, 4) and found[0, 2].tolist() == [*PALETTE[-1], 255]
    assert found[0, 0].tolist() == [*PALETTE[0], 255] and found[1, 0, 3] == 0


def test_the_outline_lies_on_the_taxels_that_it_encloses():
    """The corners of the contact are at the centres of taxels 1 and 3.

    The unit of the expected points is one taxel, and row 0 is at the bottom.
    """
    outline, = parts(pad_picture(state(), 100e3), 'polygon')
    assert outline.get('points') == '1.500,2.500 3.500,2.500 3.500,0.500 1.500,0.500'


@pytest.mark.parametrize('shape', ['unknown', 'none'])
def test_a_contact_without_a_shape_has_no_outline_and_no_size(shape):
    shown = pads_html([drawn(0.1, shape=shape)], 1)
    assert '<polygon' not in shown and 'side' not in shown


def test_taxels_that_nothing_recognises_say_so():
    assert 'not recognised' in pads_html([drawn(0.1, contact=None)], 1)


def test_names_from_topics_are_text_and_not_html():
    evil = contact(shape='<img src=x onerror=alert(1)>')
    shown = pads_html([Scales().drawn('<b>left', state(pad='<b>left', contact=evil), 0.1)], 1)
    assert '<b>' not in shown and '<img src=x' not in shown


def test_a_failure_of_the_bus_is_text_and_not_html():
    """The text of a bus failure may contain words from a log or an adapter."""
    assert '<img' not in counts_table(BusFacts(failure=Failure(BusFault.BUS_OFF, '<img src=x onerror=alert(1)>')))


def test_a_force_of_saturated_taxels_is_a_lower_bound():
    values, status = np.zeros((16, 16)), np.full((16, 16), TaxelStatus.VALID, np.uint8)
    values[4:11, 4:11], status[4:11, 4:11] = 50e3, TaxelStatus.SATURATED
    pad = PadRecogniser('left', 0.004, 'Pa', make_recogniser())
    seen = [pad.state(TaxelFrame(k / 50, k, values, status, 0), 0.0) for k in range(3)][-1].contact
    assert seen.force_is_bound and seen.size_is_bound and f'≥ {49 * 50e3 * 0.004 ** 2:.2f} N' in contact_text(seen)


def test_a_skin_of_whole_pascals_that_reads_0_and_1_is_shown():
    """The layout gives the unit, so the viewer must not guess the unit from the values."""
    values = np.zeros((16, 16))
    values[3, 3] = 1.0
    frame = TaxelFrame(0.0, 0, values, np.full((16, 16), TaxelStatus.VALID, np.uint8), 0)
    assert PadRecogniser('left', 0.004, 'Pa', make_recogniser()).state(frame, 0.0).contact.shape == 'none'


def test_colours_rise_in_brightness():
    every_fourth = PALETTE[::4].astype(int)  # Rounding to integers may hide the increase from one colour to the next.
    assert (np.diff(every_fourth @ (299, 587, 114)) > 0).all()
    assert levels(np.array([-1.0, 0.0, 50.0, 100.0, 900.0]), 100.0).tolist() == [0, 0, 128, 255, 255]


def test_a_gap_in_the_force_is_not_bridged():
    stamps = np.array([0.0, 0.1, 5.0, 5.1, 5.2])
    chart = force_chart([np.array([stamps, [1, 1, 2, NAN, 2]])], 6.0)
    assert type(chart) is str  # A page stops working if the server sends it any other type.
    line = chart.split('class="series"')[1].split(' d="')[1].split('"')[0]
    # The chart omits the NaN, and a pause of 0.2 s is too short to be a gap.
    assert line.count('M') == 2 and line.count('L') == 2


# --- Old data


def test_old_data_say_how_old_they_are_and_not_what_touches():
    shown = pads_html([drawn(3.21)], 1)
    assert 'no data for 3.2 s' in shown and 'square' not in shown and 'opacity="0.25"' in shown
    assert 'LIVE</b>' in status_html(LIVE, [drawn(3.21)], 0, 1) and 'NOT LIVE</b>' in status_html(
        LIVE, [drawn(3.21)], 0, 1)


def test_a_browser_counts_what_is_live_from_its_last_receipt():
    """The time for which a browser may show data as live starts when the browser last received an update.

    If the data are as old as the last update, all of this time remains, except the duration of one browser frame. The
    remaining time does not depend on the delay of the data.
    """
    pads = [drawn(0.3)._replace(since_receipt=0.3), drawn(0.2)._replace(since_receipt=0.3), drawn(3.0)]
    assert fresh_for(pads) == pytest.approx(OLD_AGE - FRAME_TIME) and fresh_for(pads[2:]) is None
    assert 'class="tactile-dead tactile-late" data-fresh="0.480"' in pads_html(pads[:1], 7)


def test_an_age_that_is_not_known_is_not_live():
    assert 'NOT LIVE</b>' in status_html(LIVE, [drawn(float('inf'))], 0, 1)


def test_a_recording_is_never_called_live():
    shown = status_html(LIVE._replace(player=MagicMock(position=1.0, length=9.0, is_playing=True)), [drawn(0.0)], 0, 1)
    dead = str(macros().dead())
    assert 'RECORDING' in shown and 'LIVE' not in shown.replace(dead, '')
    assert 'LIVE' not in pads_html([drawn(0.0)], 1, is_recording=True).replace(dead, '')


@pytest.mark.parametrize('age, taxel, is_live', [
    (0.05, 1.0, True), (0.05, NAN, False), (3.0, 1.0, False), (3.0, NAN, False), (NAN, 1.0, False)])
def test_a_pad_is_live_by_its_newest_valid_taxel(age, taxel, is_live):
    """One valid taxel of 16 is enough for a live pad. The page counts and marks taxels without a value."""
    values = np.full((4, 4), NAN)
    values[2, 1] = taxel
    assert drawn(age, values=values).is_live is is_live
    assert not Scales().drawn('left', None, age).is_live


def test_a_dead_skin_that_still_sends_frames_is_not_live():
    """The driver continues to publish frames with current stamps, but every taxel is NaN."""
    dead = drawn(0.05, values=np.full((4, 4), NAN))
    shown = pads_html([dead], 1)
    assert 'no valid taxels' in shown and 'square' not in shown and 'tactile-bar' not in shown
    assert '>LIVE<' not in shown and 'NOT LIVE</b>' in shown
    status = status_html(LIVE, [dead, dead._replace(name='right')], 0, 1)
    assert 'NOT LIVE</b>' in status and 'left: no valid taxels; right: no valid taxels' in status


def test_the_word_live_applies_to_all_pads_or_to_one_pad():
    live, dead = drawn(0.05), drawn(0.05, values=np.full((4, 4), NAN))._replace(name='right')
    assert '>LIVE</b>' in status_html(LIVE, [live, live], 0, 1)
    status = status_html(LIVE, [live, dead], 0, 1)
    assert 'NOT LIVE</b>' in status and 'left: LIVE' in status and 'right: no valid taxels' in status
    assert 'NOT LIVE</b>' in status_html(LIVE, [], 0, 1)


def rows_of(table):
    """Return the text of each table row, keyed by the name of the row."""
    return dict(row.removesuffix('</td></tr>').split('</td><td>') for row in re.findall('<td>(.*?</td></tr>)', table))


def test_only_pads_and_status_line_show_whether_a_pad_is_live():
    """All other parts of the page are updated less often.

    When a pad fails or returns, outdated parts would contradict the pads and the status line.
    """
    source, browser = HandSource(['left']), Sent()
    source.store.put(state())
    source.store.put_bus(BusFacts((PadFacts('left', 9, tpdos_expected=9, tpdos_received=9, tpdos_used=9),)))
    page = page_of(source, browser)
    page.start()
    until(lambda: browser.client.flush.call_count == 1, 60)
    page.taken(1)
    until(lambda: browser.client.flush.call_count == 2, 60)
    page.stop()
    page.join()
    assert 'LIVE' in page._pads.content and 'LIVE' in page._status.content
    assert '<b>left</b>' in page._health.content
    for part in (page._health, page._force, page._planes_html):
        assert 'LIVE' not in str(part.content) and 'ms old' not in str(part.content)


def test_a_status_line_that_has_become_old_in_the_browser_is_not_empty():
    shown = status_html(LIVE._replace(grasp=HELD._replace(acquired=time.monotonic())), [drawn(0.05)], 0, 1)
    assert re.findall('data-late="([A-Z ]+):', shown) == ['NOT LIVE', 'NOT KNOWN']


def test_bus_and_nodes_do_not_contradict_a_dead_pad():
    silent = NodeFacts('left', 32, NmtState.OPERATIONAL, False, 14.0, NodeFault.SILENT)
    pad = PadFacts('left', 1, tpdos_expected=2, tpdos_received=2, tpdos_used=2, nodes=(silent,))
    facts = BusFacts((pad,))
    rows = rows_of(counts_table(facts))
    assert rows['<b>left</b>'] == ''
    assert rows['bus'] == 'nodes with a fault: 1'
    assert NodeFault.SILENT.phrase in rows['node 32']
    well = BusFacts((replace(pad, nodes=(replace(silent, fault=NodeFault.NONE),)),))
    assert 'class=bad' not in counts_table(well)
    died = counts_table(well, 12.0)  # The driver has died, so the states of its bus and nodes are unknown.
    assert 'no failure' not in died and 'OPERATIONAL' not in died


# --- The grasp

HELD = GraspFacts('two_sided', is_fresh=True, is_stable=True, acquired=0.0)


def grasp_of(age, **changed):
    return macros().grasp(HELD._replace(**changed), age, 0.4)


def test_a_grasp_is_current_while_it_is_fresh_and_new():
    shown = grasp_of(0.08)
    assert 'class="tactile-live"' in shown and 'two sided, stable, fresh' in shown and '80 ms old' in shown
    assert 'two sided, not stable' in grasp_of(0.08, is_stable=False)


@pytest.mark.parametrize('age, changed', [
    (0.6, {}), (NAN, {}), (float('inf'), {}), (0.08, {'is_fresh': False, 'is_stable': False}),
    (0.08, {'contact': 'unseen', 'is_stable': False}), (0.08, {'contact': 'not_known', 'is_fresh': False})])
def test_an_old_grasp_and_one_that_is_not_known_are_not_shown_as_current(age, changed):
    shown = grasp_of(age, **changed)
    assert 'NOT KNOWN' in shown and 'live' not in shown and 'two sided' not in shown and 'stable' not in shown


@pytest.mark.parametrize('player, begin', [
    (None, '>grasp: '), (SimpleNamespace(is_playing=True, position=1.0, length=2.0), '>recorded grasp: ')])
def test_a_grasp_from_a_recording_is_marked(player, begin):
    facts = LIVE._replace(player=player, grasp=HELD._replace(acquired=time.monotonic()))
    assert begin in status_html(facts, [drawn(0.05)], 0, 1)


@pytest.mark.parametrize('pads', [[0.1], [3.0]])
def test_a_browser_hides_a_grasp_by_its_own_age(pads):
    """New taxels must not keep an old grasp on the page, and old taxels must not hide a new grasp."""
    held = HELD._replace(acquired=time.monotonic() - 0.4)
    shown = status_html(LIVE._replace(grasp=held), [drawn(age)._replace(since_receipt=0.3) for age in pads], 0, 1)
    of_pads, of_grasp = shown.split('grasp: ')
    # The grasp must not lie inside an element that is hidden when a pad is old.
    assert of_pads.count('<div') - of_pads.count('</div') == 1
    left = float(of_grasp.split('data-fresh="')[1].split('"')[0])
    assert left == pytest.approx(OLD_AGE - FRAME_TIME - 0.4 + 0.3, abs=0.1)


def test_a_source_forgets_its_data_when_it_stops():
    store = Store(['left'])
    store.put(state())
    store.put_grasp(HELD)
    store.clear()
    assert store.shown().grasp is None and store.shown().pads == {'left': None}
    assert 'this source has no grasp' in macros().grasp(store.shown().grasp, NAN, NAN)


def test_stamps_of_another_time_are_reported_as_a_replay():
    """A replay publishes stamps from its log, which lie in the past."""
    behind = clock_difference([drawn(0.1, stamp=1000.0)], 8200.1)
    assert behind == pytest.approx(7200)
    replayed = drawn(0.1, stamp=time.time() - 7200.1)
    assert '7200 s before the time of this computer' in status_html(LIVE, [replayed], 0, 1)
    assert 'of this computer' not in status_html(LIVE, [drawn(0.1, stamp=time.time() - 0.1)], 0, 1)
    assert np.isnan(clock_difference([drawn(9.0, stamp=1000.0)], 8200.1))


def test_a_status_that_is_no_longer_sent_is_marked_as_old():
    """The driver died after its last message, which reported no failure."""
    well = BusFacts()
    assert 'OLD: nothing newer for 12 s' in counts_table(well, 12.0) and 'OLD' not in counts_table(well, 1.1)
    store = Store(['left'])
    store.put_bus(well, 12.0)
    assert time.monotonic() - store.shown().bus_acquired == pytest.approx(12, abs=1)


def test_the_age_of_a_status_in_a_recording_is_that_at_its_time():
    timeline, well = Timeline(), BusFacts()
    for stamp in (1.0, 9.0):
        timeline.add('left', frame(stamp), 0.004, 'Pa')
    timeline.add_facts(2.0, well)
    assert timeline.facts(1.5) == (None, 0.0) and timeline.facts(8.5) == (well, 6.5)
    timeline.close()


# --- Health


def counted(lost, expected, overruns=0):
    return BusFacts((
        PadFacts('left', expected - lost, lost, tpdos_expected=expected, tpdos_received=expected,
                 tpdos_used=expected - lost, losses={LossReason.LATE: lost}),), queue_overruns=overruns)


def test_a_loss_is_red_for_a_minute():
    history, lost, later = FactsHistory(RECENT_TIME), counted(7, 200, 3), counted(7, 5000, 3)
    history.before(counted(0, 100), 1000.0)
    table = counts_table(lost, before=history.before(lost, 1001.0))
    assert 'class=bad' in table and rows_of(table)['lost: late'] == '7 (7 in 1 s)'
    assert rows_of(table)['queue overruns'] == '3 (3 in 1 s)'
    history.before(lost, 1001.5)  # A page asks for the history more often than status messages arrive.
    table = counts_table(later, before=history.before(later, 1061.6))
    assert 'class=bad' not in table and rows_of(table)['lost: late'] == '7 (0 in 60 s)'
    assert 'class=bad' in counts_table(later)  # For a recording, the table shows all losses since its beginning.


def test_restarted_counters_are_not_compared_with_earlier_ones():
    """The driver was restarted, so its 9 losses must not be read as 2 more than the 7 losses before."""
    history = FactsHistory(RECENT_TIME)
    for stamp, facts in enumerate((counted(7, 5000), counted(9, 90), counted(12, 190))):
        before = history.before(facts, float(stamp))
    assert rows_of(counts_table(facts, before=before))['lost: late'] == '12 (3 in 1 s)'


def test_losses_are_listed_by_reason():
    losses = dict.fromkeys(LossReason, 0) | {LossReason.LATE: 7}
    node = NodeFacts('left', 32, NmtState.OPERATIONAL, True, 0.1, NodeFault.TWO_SENDERS)
    pad = PadFacts('left', frames_complete=9, frames_incomplete=1, tpdos_expected=100, tpdos_received=99, tpdos_used=92,
                   losses=losses, nodes=(node,))
    facts = BusFacts((pad,), Failure(BusFault.BUS_OFF, 'wire cut'), queue_overruns=3)
    assert losses_in(pad_counts(pad)) == {'late': 7}
    table = counts_table(facts)
    for said in ('lost: late</td><td>7', '8 missing', 'queue overruns</td><td>3', 'wire cut', 'two devices send'):
        assert said in table
    assert 'no bus status' in counts_table(None)


# --- Recordings on disk


def frame(stamp, value=1.0):
    return TaxelFrame(stamp, int(stamp * 10), np.full((2, 3), value, np.float32), np.ones((2, 3), np.uint8), 2)


def test_a_timeline_gives_back_the_frame_of_a_time():
    timeline = Timeline()
    for stamp in (1.0, 2.0, 3.0):
        assert timeline.add('left', frame(stamp, stamp), 0.004, 'Pa')
    assert timeline.index('left', 0.9) == -1 and timeline.index('right', 2.0) == -1
    found = timeline.moment('left', timeline.index('left', 2.7))
    assert found.frame.stamp == 2.0 and found.frame.values.tolist() == [[2, 2, 2], [2, 2, 2]]
    assert found.frame.missing_can_frames == 2 and (found.pitch, found.unit) == (0.004, 'Pa')
    # A pad with the same name and another pitch is a different pad.
    assert not timeline.add('left', frame(4.0), 0.005, 'Pa')
    timeline.close()


# --- The terminal


class StopAfterTwo(Event):
    """Requests a stop after two pictures, without waiting between them."""

    def __init__(self):
        super().__init__()
        self._pictures = count()

    def wait(self, timeout=None):
        return next(self._pictures) == 2


def shown_on(stream, source):
    show_in_terminal(source, StopAfterTwo(), stream)
    return stream.getvalue()


def test_a_terminal_says_that_nothing_comes_and_draws_nothing(monkeypatch):
    monkeypatch.setenv('COLUMNS', '100')
    source = HandSource(['left'])
    source.store.put(state(acquired=time.monotonic() - 60))
    shown = shown_on(Terminal(), source)
    assert 'no data for 60' in shown and 'square' not in shown and '\x1b[48;5;' not in shown
    assert (source.begun, source.ended) == (1, 1)


def test_a_terminal_shows_shape_and_size(monkeypatch):
    monkeypatch.setenv('COLUMNS', '100')
    source = HandSource(['left'])
    source.store.put(state())
    shown = shown_on(Terminal(), source)
    assert 'square 97 %' in shown and 'side 8.0 mm' in shown and '\x1b[48;5;' in shown


@dataclass(frozen=True)
class ReportedPad(PadFacts):
    level: int = 3
    message: str = 'node 32 is silent'


@dataclass(frozen=True)
class ReportedBus(BusFacts):
    """The fields of a SkinStatus that the viewers read."""

    level: int = 3
    message: str = 'growing: queue_overruns'


STATUS = ReportedBus((ReportedPad('left', 1),))


@pytest.mark.parametrize('stream', [Terminal, io.StringIO])
def test_a_terminal_shows_the_level_and_the_text_of_the_driver(stream, monkeypatch):
    monkeypatch.setenv('COLUMNS', '100')
    source = HandSource(['left'])
    source.store.put(state())
    source.store.put_bus(STATUS)
    shown = shown_on(stream(), source)
    assert 'driver: ERROR, bus: growing: queue_overruns' in shown and 'pad left: ERROR: node 32 is silent' in shown
    source.store.put_bus(STATUS, age=60.0)  # The driver has ended.
    shown = shown_on(stream(), source)
    assert 'ERROR' not in shown and 'no status for 6' in shown


def test_the_page_shows_the_level_and_the_text_of_the_driver():
    rows = rows_of(counts_table(STATUS))
    assert rows['driver'] == 'ERROR, bus: growing: queue_overruns'
    assert rows['pad left'] == 'ERROR: node 32 is silent'
    assert 'ERROR' not in counts_table(STATUS, 12.0) and 'driver' not in rows_of(counts_table(BusFacts()))


def test_a_name_is_not_a_command_to_the_terminal(monkeypatch):
    """A bag from another source may contain a name with control characters.

    The sequence ESC c would clear the terminal.
    """
    monkeypatch.setenv('COLUMNS', '100')
    for stream in (Terminal(), io.StringIO()):
        source = HandSource(['left\x1bc'])
        source.store.put(state(pad='left\x1bc', contact=contact(shape='plug\x1bc')))
        source.title = 'bag\x1bc'
        shown = shown_on(stream, source)
        assert 'left' in shown and 'plug' in shown and '\x1bc' not in shown


def test_a_narrow_terminal_gets_one_line(monkeypatch):
    monkeypatch.setenv('COLUMNS', '40')
    source = HandSource()
    shown = shown_on(Terminal(), source)
    assert max(map(len, shown.replace('\x1b[2K', '').replace('\x1b[1A', '').replace('\x1b[J', '').split('\n'))) < 40


# --- The page


class Sent:
    """Records the updates that a browser would receive, grouped by part of the page."""

    def __init__(self):
        self.client = MagicMock(client_id=7)
        self.client.camera = MagicMock(aspect=1.6, image_width=1440, image_height=900)
        self.pads = MagicMock()
        self.client.gui.add_html.side_effect = lambda text: MagicMock()
        self.client.gui.add_checkbox.side_effect = lambda label, value: MagicMock(value=value)


def page_of(source, browser):
    from tactile_node.viewing.page import Page
    return Page(browser.client, source, lambda: True)


@pytest.mark.slow
def test_a_browser_that_does_not_answer_gets_nothing_more_and_then_the_newest():
    source, browser = HandSource(['left']), Sent()
    source.store.put(state(stamp=0.0))
    page = page_of(source, browser)
    page.start()
    flush = browser.client.flush
    until(lambda: flush.call_count == 1)
    for k in range(500):
        source.store.put(state(stamp=0.01 * k))
    time.sleep(0.3)
    assert flush.call_count == 1  # No further update waits in a queue for this browser.
    page.taken(0)  # This message confirms a different update.
    time.sleep(0.1)
    assert flush.call_count == 1
    page.taken(1)
    until(lambda: flush.call_count == 2)
    page.stop()
    page.join()


def test_planes_are_computed_only_while_they_are_open(monkeypatch):
    from tactile_node.viewing import page as module
    computed = []
    monkeypatch.setattr(module, 'planes_html', lambda masks: computed.append(masks) or '')
    source, browser = HandSource(['left']), Sent()
    mask = np.ones((4, 4), bool)
    source.store.put(state(contact=contact(mask=mask)))
    page = page_of(source, browser)
    page.start()
    until(lambda: browser.client.flush.call_count == 1)
    assert computed == []
    page._planes_wanted.value = True
    for number in range(1, 9):
        source.store.put(state(contact=contact(mask=mask)))
        page.taken(number)
        until(lambda number=number: browser.client.flush.call_count > number)
    assert computed and computed[-1][0] is mask
    page.stop()
    page.join()


def test_a_point_lies_on_the_side_of_the_curve_that_the_classifier_takes():
    """According to section 7 of the paper, a long bar is a rectangle.

    The point of the bar must lie in the area above the first curve.
    """
    from tactile_node.viewing.planes import planes_html
    mask = np.zeros((16, 16), bool)
    mask[6:9, 2:14] = True
    pictures = planes_html({0: mask}).split('class="tactile-planes">')[1]
    first = fromstring(pictures.split('</svg>')[0] + '</svg>')
    circle = next(element for element in first.iter() if element.tag.endswith('circle'))
    line = next(element for element in first.iter() if element.tag.endswith('polyline'))
    corners = np.array([pair.split(',') for pair in line.get('points').split()], float)
    assert float(circle.get('cy')) < np.interp(float(circle.get('cx')), *corners.T)
