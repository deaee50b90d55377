"""Facts in a report, taken from recordings into which faults were inserted by hand."""

import gzip
import threading

import can
import numpy as np
import pytest
from test_logs import DATA

from tactile_node.assembly.facts import losses_in
from tactile_node.conditioning.taxel_faults import TaxelFault
from tactile_node.errors import LogError
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.recognition import Recognition, Shape
from tactile_node.skin.pads import make_pads
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus
from tactile_node.viewing.chart import thin
from tactile_node.viewing.findings import Remark, findings
from tactile_node.viewing.model import KEPT_ENTRIES, Ends, LongestGaps
from tactile_node.viewing.node_record import BusRecord, NodeRecords
from tactile_node.viewing.recordings import LogRecording
from tactile_node.viewing.report_page import page_of
from tactile_node.viewing.reporter import LogReporter
from tactile_node.viewing.status_record import StatusRecord
from tactile_node.viewing.taxel_record import Mark, TaxelHealth, marks_of, no_value_share
from tactile_node.viewing.touch import MOST_PICTURES
from tactile_node.viewing.touch_finder import ReportedTouchFinder

SESSION = DATA / 'sim16x16_two_pads.log.gz'
BEGIN = 1_700_000_000
NAN = float('nan')
#: Node 32 sends its device name of 16 bytes by segmented upload (CiA 301, 7.2.4.3.6).
NAME_UPLOAD = '''620#4008100000000000 5A0#4108100010000000 620#6000000000000000 5A0#003C736372697074
620#7000000000000000 5A0#103E616C65727428 620#6000000000000000 5A0#0B31290000000000'''.split()


def session(until=3.1):
    """Return the lines of the session for the setup and the first touch."""
    with gzip.open(SESSION, 'rt') as file:
        return [line for line in file.read().splitlines() if float(line[1:18]) < BEGIN + until]


def logged(path, lines):
    path.write_text(''.join(f'{line}\n' for line in lines))
    return str(path)


def report_of(path, *, node_ids=(32, 64), layout='sim16x16.yaml', any_device=False, **options):
    log = LogRecording(str(path), make_pads([layout], list(node_ids)), any_device=any_device)
    return LogReporter(log, **options).report(threading.Event())


def found_in(report):
    return {(each.finding, each.where): each.number for each in findings(report)}


@pytest.fixture(scope='module')
def whole():
    return report_of(SESSION, bit_rate=1_000_000)


@pytest.mark.slow
def test_touches_of_a_session_with_their_size(whole):
    """The five shapes are pressed one after another, each on 60 taxels of 2 mm pitch.

    The expected areas are the areas of the outlines.
    """
    order = ['circle', 'square', 'rectangle', 'right_triangle', 'isosceles_triangle']
    for pad in whole.pads:
        assert [touch.contact.shape for touch in pad.touches] == order and pad.touches.left_out == 0
        sizes = [dict(touch.contact.dimensions) for touch in pad.touches]
        areas = [np.pi * sizes[0]['radius']**2, sizes[1]['side']**2, sizes[2]['long'] * sizes[2]['short'],
                 sizes[3]['long_leg'] * sizes[3]['short_leg'] / 2, sizes[4]['base'] * sizes[4]['height'] / 2]
        np.testing.assert_allclose(areas, 60 * 0.002**2, rtol=0.05)
        for before, after in zip(pad.touches, pad.touches[1:]):
            assert before.begin < before.end < after.begin
        assert all(touch.contact.confidence > 0.9 and touch.contact.outline is not None for touch in pad.touches)
        assert (pad.frames, pad.incomplete, pad.lost_frames, losses_in(pad.counts)) == (120, 0, 0, {})


def test_devices_and_bus_of_a_session(whole):
    assert [(node.node_id, node.pad) for node in whole.nodes] == [(32, 'pad32'), (64, 'pad64')]
    node = whole.nodes[0]
    assert node.objects[0x1018, 1] == (bytes.fromhex('C1050000'),)
    assert (0x1008, 0) not in node.objects and (0x1018, 4) not in node.objects
    assert [change.text for change in node.nmt] == ['BOOT-UP', 'OPERATIONAL'] and node.heartbeats == 48
    # The driver sends PRE-OPERATIONAL, OPERATIONAL and PRE-OPERATIONAL to each node.
    assert [command.text.rpartition(' to ')[2] for command in whole.bus.commands] == 3 * ['node 32', 'node 64']
    assert len({command.text for command in whole.bus.commands}) == 4
    # The bus carries 25 sweeps a second, each with a SYNC of at most 55 bits and 64 TPDOs of 135 bits. Each node adds
    # ten heartbeats a second, each with one byte and 65 bits.
    assert whole.bus.load.bit_rates[3] == 25 * (55 + 64 * 135) + 20 * 65
    assert whole.bus.load.shares[3] == pytest.approx(0.218675)
    assert [round(gap.seconds, 2) for gap in whole.bus.gaps] == [1.75]
    assert whole.recording.end - whole.recording.begin == pytest.approx(6.768771, abs=1e-5)
    assert whole.bus.channels == ('can0',)
    assert {finding for finding, _ in found_in(whole)} == {Remark.BUS_GAPS}


def test_faults_inserted_into_a_log_are_found(tmp_path):
    lines = session()
    tpdos = [k for k, line in enumerate(lines) if ' 1A0#' in line]
    at = tpdos[10]
    emcy = lines[at].split()[0] + ' can0 0A0#1042090000000000 R'
    short = ' '.join([*lines[tpdos[15]].split()[:2], '1A0#00', 'R'])
    stamped = [f'{lines[tpdos[2]].split()[0]} can0 {frame} R' for frame in NAME_UPLOAD]
    boot = lines[tpdos[20]].split()[0] + ' can0 740#00 R'
    stranger = lines[at].split()[0] + ' can0 705#05 R'
    changed = dict.fromkeys(range(len(lines)), ())
    changed[at] = (emcy, stranger)
    changed[tpdos[2]] = stamped
    changed[tpdos[20]] = (boot,)
    out = []
    for k, line in enumerate(lines):
        out += [short] if k == tpdos[15] else [] if k == tpdos[5] else [line]
        if k == tpdos[8]:
            out.append(line)  # This line appears twice in the log.
        out += changed[k]
    report = report_of(logged(tmp_path / 'x.log', out))
    left, right = report.pads
    assert losses_in(left.counts) == {'duplicate': 1, 'short': 1} and losses_in(right.counts) == {}
    assert (left.frames, left.incomplete, right.incomplete) == (28, 2, 0)
    assert left.counts['tpdos_received'] == left.counts['tpdos_used'] + 2  # Each received TPDO was used or lost.
    assert '<tr class=bad><td>lost: duplicate</td><td>1</td></tr>' in page_of(report)
    node5, node32, node64 = report.nodes
    assert node32.objects[0x1008, 0] == (b'<script>alert(1)',)
    error, = node32.emergencies
    assert error.text.startswith('EMCY 0x4210') and 'generic, temperature' in error.text and error.is_problem
    assert [change.text for change in node64.nmt].count('BOOT-UP') == 2 and node64.restarts == 1
    assert node5.pad is None and node5.heartbeats == 1 and node5.objects == {}
    expected = {(Remark.LOST_CAN_FRAMES, 'pad32'): 2, (Remark.INCOMPLETE, 'pad32'): 2,
                (Remark.EMERGENCIES, '32'): 1, (Remark.BOOTED_AGAIN, '64'): 1, (Remark.NODE_OF_NO_PAD, '5'): 1}
    assert expected.items() <= found_in(report).items()
    with_gaps = left.health.by_status[TaxelStatus.STALE]
    assert with_gaps.sum() == 2 * 8 and with_gaps.max() == 2  # The TPDO with 8 taxels has no valid data in two sweeps.
    assert (marks_of(left.health) == Mark.SOME_MISSING).sum() == 8


@pytest.mark.slow
def test_the_report_omits_the_taxels_of_another_device(tmp_path):
    """The log contains the product code 0x16160009, which differs from the product code in the layout's EDS."""
    lines = [line.replace('5A0#4318100208001616', '5A0#4318100209001616') for line in session()]
    path = logged(tmp_path / 'x.log', lines)
    report = report_of(path)
    left, right = report.pads
    assert (left.contradiction.node_id, left.contradiction.object_index) == (32, 0x1018)
    assert not left.touches and left.samples == () and left.health is None
    assert len(right.touches) == 1 and right.contradiction is None
    assert (Remark.WRONG_DEVICE, 'pad32') in found_in(report)
    problem, = (each for each in findings(report) if each.finding is Remark.WRONG_DEVICE)
    assert 'sim16x16.yaml' in problem.sentence and '--layout' in problem.sentence
    assert report.nodes[0].objects[0x1018, 2] == (bytes.fromhex('09001616'),)
    trusted, = report_of(path, node_ids=(32,), any_device=True).pads
    assert trusted.contradiction is None and len(trusted.touches) == 1


def test_an_identity_that_changes_is_two_devices():
    """In the log, the device reports two different revisions.

    Responses of another node must not be counted.
    """
    records = NodeRecords({32: 'left'}, frozenset())
    for can_id, data in ((0x620, '4018100300000000'), (0x5A0, '4318100300000100'), (0x5A1, '4318100300000300'),
                         (0x620, '4018100300000000'), (0x5A0, '4318100300000200'), (0x620, '4018100300000000'),
                         (0x5A0, '4318100300000200')):
        records.feed(can.Message(1.0, can_id, False, data=bytes.fromhex(data)))
    node, other = records.reports()
    assert node.objects == {(0x1018, 3): (bytes.fromhex('00000100'), bytes.fromhex('00000200'))}
    assert other.node_id == 33 and other.objects == {}


@pytest.mark.slow
def test_taxels_of_another_node_are_not_given(tmp_path):
    """With node-ID 33, most TPDOs of node 32 would match the layout."""
    log = logged(tmp_path / 'x.log', session())
    pad, = report_of(log, node_ids=(33,)).pads
    assert pad.strangers == (32,) and pad.counts['tpdos_used'] > 0 and not pad.touches and pad.health is None
    report = report_of(log, node_ids=(9,))
    pad, = report.pads
    assert pad.counts['tpdos_used'] == 0 and not pad.touches and pad.strangers == ()
    assert (Remark.NO_TAXELS, 'pad9') in found_in(report)
    silent = next(node for node in report.nodes if node.node_id == 9)
    assert silent.heartbeats == 0 and not silent.nmt and silent.longest_pause is None


@pytest.mark.slow
def test_a_log_cut_short_is_reported_up_to_there(tmp_path):
    data = SESSION.read_bytes()
    path = tmp_path / 'x.log.gz'
    path.write_bytes(data[:len(data) * 2 // 3])
    report = report_of(path)
    assert report.recording.unread >= 1 and report.recording.problem
    assert 0 < len(report.pads[0].touches) < 5
    assert found_in(report)[Remark.UNREAD, ''] == report.recording.unread
    assert all(touch.end <= report.recording.end for touch in report.pads[0].touches)


def test_no_log_and_a_log_of_two_buses_are_errors(tmp_path):
    with pytest.raises(LogError, match='no such file'):
        report_of(tmp_path / 'x.log')
    lines = session()
    other = [line.replace('can0', 'can1') for line in lines if ' 1A0#' in line]
    with pytest.raises(LogError, match='can1'):
        report_of(logged(tmp_path / 'x.log', sorted(lines + other)))


def test_two_buses_in_one_load_are_pointed_out():
    bus = BusRecord(None)
    for stamp, channel, is_rx in ((0.0, 'can0', True), (1.0, 'can1', True), (2.0, 'vcan0', False)):
        bus.feed(can.Message(stamp, 0x701, False, data=b'\x05', channel=channel, is_rx=is_rx))
    assert bus.report({}).channels == ('can0', 'can1')


def pressed(taxels, value=50e3, missing=False):
    values = np.full((16, 16), NAN if missing else 0, np.float32)
    if not missing:
        values[5:5 + taxels, 5:5 + taxels] = value
    status = np.full((16, 16), TaxelStatus.STALE if missing else TaxelStatus.VALID, np.uint8)
    return values, status


def touches_of(frames, period=0.02):
    """Return the touches found in ``frames``.

    Each frame is a pair of values and status, or None for a time without a frame.
    """
    finder = ReportedTouchFinder('left', 0.004, 'Pa', make_recogniser())
    for k, pair in enumerate(frames):
        if pair is not None:
            finder.feed(TaxelFrame(BEGIN + k * period, k, *pair, 0))
    finder.end()
    return finder.found


def test_a_touch_begins_and_ends_with_its_contact():
    found = touches_of([pressed(0)] * 10 + [pressed(4)] * 6 + [pressed(0)] * 5 + [pressed(5, 80e3)] * 3)
    first, second = found
    assert (first.frames, second.frames, first.is_open, second.is_open) == (6, 3, False, True)
    assert first.begin == pytest.approx(BEGIN + 0.2) and first.end == pytest.approx(BEGIN + 0.3)
    assert first.contact.force == pytest.approx(16 * 50e3 * 0.004**2, rel=1e-3)
    assert second.contact.mask.sum() == 25 and second.picture.values.max() == np.float32(80e3)


def test_a_frame_in_which_the_pad_is_not_seen_ends_no_touch():
    hidden = touches_of([pressed(4)] * 5 + [pressed(0, missing=True)] * 5 + [pressed(4)] * 5 + [pressed(0)])
    touch, = hidden
    assert touch.frames == 10 and touch.end == pytest.approx(BEGIN + 14 * 0.02)


def test_a_row_that_never_comes_joins_no_touches():
    """The pad is never seen completely, but the release of the pressed taxels is seen."""
    frames = [pressed(4)] * 5 + [pressed(0)] * 5 + [pressed(4)] * 5
    for values, status in frames:
        values[7, :8], status[7, :8] = NAN, TaxelStatus.STALE
    assert [touch.frames for touch in touches_of(frames)] == [5, 5]


def test_a_time_without_frames_ends_one():
    assert len(touches_of([pressed(4)] * 5 + [None] * 40 + [pressed(4)] * 5)) == 2
    assert len(touches_of([pressed(4)] * 5 + [None] * 10 + [pressed(4)] * 5)) == 1


class Joining:
    """A recogniser that reports a square consisting of all pieces."""

    def recognise(self, contact, visibility=None):
        return Recognition.certain(Shape.SQUARE)._replace(joined=True)


def test_force_over_time_is_that_of_the_whole_contact():
    """A column without load splits a square of 8 x 8 taxels into 8 x 5 and 8 x 2 taxels of 50 kPa and 16 mm²."""
    values, status = pressed(8)
    values[:, 10] = 0
    finder = ReportedTouchFinder('left', 0.004, 'Pa', Joining())
    finder.feed(TaxelFrame(BEGIN, 0, values, status, 0))
    finder.end()
    assert finder.samples[0].force == pytest.approx(56 * 50e3 * 16e-6)
    assert finder.found[0].contact.force == pytest.approx(56 * 50e3 * 16e-6)


@pytest.mark.slow
def test_the_longest_touches_keep_their_pictures():
    frames = []
    for length in range(MOST_PICTURES + 3, 0, -1):
        frames += [pressed(3)] * length + [pressed(0)] * 2
    touches = touches_of(frames)
    assert [touch.picture is not None for touch in touches] == [True] * MOST_PICTURES + [False] * 3


def test_marks_of_taxels():
    by_status = np.zeros((len(TaxelStatus), 1, 7), int)
    by_status[TaxelStatus.VALID, 0] = [4, 4, 4, 2, 0, 0, 0]
    by_status[TaxelStatus.SATURATED, 0, 2] = 0
    by_status[TaxelStatus.STALE, 0] = [0, 0, 0, 2, 4, 0, 0]
    by_status[TaxelStatus.UNMAPPED, 0, 5] = 4
    by_status[TaxelStatus.DEAD, 0, 6] = 4
    faults = np.zeros((1, 7), np.uint8)
    faults[0, 2] = TaxelFault.FLICKERING
    health = TaxelHealth(4, by_status, np.array([[0, 1, 0, 0, NAN, NAN, NAN.real]]),
                         np.array([[2, 1, 3, 1, NAN, NAN, NAN]]), faults)
    assert marks_of(health).tolist() == [[Mark.GOOD, Mark.NEVER_CHANGED, Mark.FLICKERING, Mark.SOME_MISSING,
                                          Mark.NO_VALUE, Mark.UNMAPPED, Mark.DEAD]]
    np.testing.assert_array_equal(no_value_share(health), [[0, 0, 0, 0.5, 1, NAN, 1]])


class Status:
    """A message object that has the given fields and no others."""

    def __init__(self, **fields):
        self.__dict__.update(fields)


def status(load=0.3, level=1, message='', late=0, emcy=0, nmt=5):
    node = Status(node_id=32, nmt_state=nmt, fault_text='', emcy_count=emcy, emcy_last='EMCY 0x4210', emcy_active='')
    pad = Status(pad='left', level=1, message='', loss_reasons=['late', 'short'], loss_counts=np.array([late, 7]),
                 nodes=[node], frames_complete=9, frames_incomplete=0, tpdos_expected=99, tpdos_received=99,
                 tpdos_used=80)
    return Status(bus_load=load, level=level, message=message, failure='', pads=[pad])


def test_counts_of_the_driver_are_those_within_the_recording():
    record = StatusRecord()
    for k, each in enumerate((status(late=5, emcy=2), status(late=8, emcy=3), status(late=1, emcy=0))):
        record.feed(BEGIN + k, each)
    # The count of late TPDOs rises by 3. The driver then restarts, and its new count of 1 is added.
    assert losses_in(record.counts('robot/left')) == {'late': 4, 'short': 7}
    assert record.counts('right') is None
    node, = record.nodes()
    assert node.emergencies.count == 1 and [each.text for each in node.emergencies] == ['EMCY 0x4210']
    assert node.objects == {} and node.heartbeats is None


def test_reports_of_the_driver_are_listed_when_they_change():
    record = StatusRecord()
    for k, (level, message) in enumerate([(1, ''), (3, 'no frames'), (3, 'no frames'), (1, '')]):
        record.feed(BEGIN + k, status(level=level, message=message))
    assert [(each.stamp, each.is_problem) for each in record.bus().reported] == [(BEGIN + 1, True), (BEGIN + 3, False)]
    np.testing.assert_allclose(record.bus().load.shares, 0.3)
    nothing = StatusRecord()
    assert nothing.bus().reported is None and nothing.bus().load is None and nothing.nodes() is None


def test_a_clock_that_is_set_forward_costs_no_memory():
    bus = BusRecord(None)
    for stamp in (0.0, 0.5, 1.0, 2.0, BEGIN, BEGIN + 0.5, BEGIN + 1.0):
        bus.feed(can.Message(stamp, 0x181, False, data=bytes(8)))
    load = bus.report({}).load
    assert len(load.stamps) < 20 and load.bit_rates.max() == 2 * 135
    assert load.mean == pytest.approx(6 * 135 / BEGIN, rel=0.01)


def test_memory_is_bounded():
    ends = Ends()
    for k in range(5 * KEPT_ENTRIES):
        ends.add(k)
    assert tuple(ends) == (*range(KEPT_ENTRIES), *range(4 * KEPT_ENTRIES, 5 * KEPT_ENTRIES))
    assert ends.count == 5 * KEPT_ENTRIES
    gaps = LongestGaps(0.5)
    for k in range(200):
        gaps.feed(k * k)
    assert gaps.count == 199 and [gap.seconds for gap in gaps] == [2 * k + 1 for k in range(149, 199)]
    kept = thin(np.r_[np.zeros(5000), 9, np.zeros(5000)])
    assert len(kept) <= 900 and 5000 in kept
