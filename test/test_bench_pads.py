"""The pure parts of bench/bench_pads.py: whether its ledger would show a silent loss."""


import pytest
from pads_cases import Case
from pads_ledger import Counts, Station, ledger

from tactile_node.cia301.frame_bits import Frame
from tactile_node.simulator.wire import Wire
from tactile_node.skin.pads import check_pads, make_pad

#: 10 SYNCs to one pad of 32 TPDOs: 8 answered, 1 skipped, 1 TPDO not read, 3 late; 10 frames, 7 shapes
FAIR = Counts(pads=1, tpdos=32, syncs_left_out=2, sweeps=8, sweeps_skipped=1, unread=1, queue_overruns=0,
              received=255, used=252, missing=68, lost=3, outages=0, published=10,
              processor=Station(received=9, processed=8, skipped=1, overtaken=1),
              classifier=Station(received=8, processed=7, skipped=1, overtaken=0, dropped=1))


def unaccounted(counts):
    return {step.name: step.unaccounted for step in ledger(counts) if step.unaccounted}


def test_what_is_counted_on_the_way_is_no_silent_loss():
    assert unaccounted(FAIR) == {}


@pytest.mark.parametrize('silent, step', [
    ({'unread': 0}, 'TPDO on the wire -> driver'), ({'missing': 67}, 'TPDOs due -> used'),
    ({'processor': Station(9, 8, skipped=0, overtaken=1)}, 'taxels published -> processor'),
    ({'processor': Station(9, 8, skipped=1, overtaken=0)}, 'processor -> contact'),
    ({'classifier': Station(7, 7, skipped=0)}, 'contact published -> classifier'),
    ({'classifier': Station(8, 7, skipped=1)}, 'classifier -> shape')])
def test_one_that_no_one_has_counted_shows(silent, step):
    assert unaccounted(FAIR._replace(**silent)) == {step: 1}


def test_a_sweep_may_wait_for_its_period_but_not_more():
    assert unaccounted(FAIR._replace(lost=0, received=284, sweeps=9)) == {'TPDO on the wire -> driver': 3}
    assert unaccounted(FAIR._replace(lost=0, received=252 + 33, unread=0, sweeps=9)) == {
        'TPDO on the wire -> driver': 3, 'TPDO in the driver -> taxel frame': 1}


def test_counts_of_a_session_are_differences():
    assert (FAIR - FAIR)._replace(pads=0, tpdos=0) == Counts(*[0] * 13, Station(), Station())


@pytest.mark.parametrize('pads', [1, 2, 3, 4])
def test_the_last_tpdo_of_each_pad_ends_when_the_wire_says(pads):
    """Latency is counted from there; the arbitration mixes the sweeps of the pads."""
    case, wire = Case('one', 1, pads, 50), Wire()
    placed = tuple(make_pad(f'pad{node}', node, 'sim16x16.yaml') for node in (32, 40, 48, 56)[:pads])
    check_pads(placed)
    for pad, node in zip(placed, (32, 40, 48, 56)):
        sender = wire.join()
        for tpdo in pad.layout.tpdos:
            sender.put(55e-6 + 0.0003, Frame(tpdo.cob_id.of(node), bytes(8)))
    ends = {carried.sender: carried.end for carried in wire.advance(1.0)}
    assert case.sweep_ends == pytest.approx([ends[sender] for sender in wire.senders])


def test_the_head_of_a_shape_is_read_from_its_bytes():
    rclpy = pytest.importorskip('rclpy')
    pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')
    from pads_consumer import head_of
    from rclpy.serialization import serialize_message

    from tactile_skin.msg import ContactShape
    assert rclpy
    for frame in ('', 'a', 'pad', 'longer/pad_frame'):
        message = ContactShape(sequence=12345678901, left_out=7)
        message.header.frame_id = frame
        message.header.stamp.sec, message.header.stamp.nanosec = 1_700_000_000, 250_000_000
        assert head_of(serialize_message(message)) == (1_700_000_000.25, 12345678901, 7)
