"""A pad that consists of two CANopen nodes, tested byte by byte and end to end.

Node 1 sends 0x181 and 0x281, while node 5 sends 0x185 and 0x285.
"""

import itertools

import numpy as np
import pytest
from can_bench import Loss, only, telling, tiny_layout

from tactile_node.assembly.facts import LossReason
from tactile_node.assembly.sync_assembler import SyncAssembler
from tactile_node.errors import ConfigurationError
from tactile_node.skin.pads import PadSettings, check_pads, make_pads
from tactile_node.taxel_frame import TaxelStatus

TWO = '''
rows: 4
cols: 2
pitch: 0.003
nodes: 2
value: {unit: Pa, scale: 1.0, offset: 0, bits: 8}
tpdos:
- {node: 0, number: 1, cob_id: $NODEID+0x180, map: [[0x2000, 1, 16]], taxels: [[0, 0, 0], [0, 1, 8]]}
- {node: 0, number: 2, cob_id: $NODEID+0x280, map: [[0x2000, 2, 16]], taxels: [[1, 0, 0], [1, 1, 8]]}
- {node: 1, number: 1, cob_id: $NODEID+0x180, map: [[0x2000, 1, 16]], taxels: [[2, 0, 0], [2, 1, 8]]}
- {node: 1, number: 2, cob_id: $NODEID+0x280, map: [[0x2000, 2, 16]], taxels: [[3, 0, 0], [3, 1, 8]]}
'''
LAYOUT = 'nodes2_12x8_12bit.yaml'
FIRST, SECOND = ((0x181, b'\x01\x02'), (0x281, b'\x03\x04')), ((0x185, b'\x05\x06'), (0x285, b'\x07\x08'))


@pytest.fixture
def assembler(tmp_path):
    return telling(SyncAssembler(tiny_layout(tmp_path, TWO), (1, 5)))


def feed(assembler, *frames, at=9.0):
    return only([assembler.feed(can_id, data, at) for can_id, data in frames][-1])


@pytest.mark.parametrize('order', sorted(set(itertools.permutations('AABB'))), ids=''.join)
def test_nodes_may_interleave_as_arbitration_has_it(assembler, order):
    senders = {'A': iter(FIRST), 'B': iter(SECOND)}
    assembler.sync(0.0)
    frame = feed(assembler, *(next(senders[node]) for node in order))
    assert frame.values.tolist() == [[1, 2], [3, 4], [5, 6], [7, 8]]
    assert assembler.facts().used_by_node == (2, 2)


def test_a_silent_node_takes_only_its_own_taxels(assembler):
    assembler.sync(0.0)
    feed(assembler, *FIRST)
    frame, = assembler.end_period()
    assert frame.values[:2].tolist() == [[1, 2], [3, 4]] and np.isnan(frame.values[2:]).all()
    assert frame.missing_can_frames == 2 and (frame.status[2:] == TaxelStatus.STALE).all()
    assert assembler.facts().used_by_node == (2, 0)


def test_the_delayed_tail_of_one_node_goes_back_once_that_node_begins_its_next_sweep(assembler):
    assembler.sync(0.0)
    feed(assembler, FIRST[0], *SECOND)
    assert assembler.sync(10.0) == ()
    assert feed(assembler, (0x281, b'\x63\x63'), *SECOND, at=11.0) is None
    before, = assembler.feed(*FIRST[0], 11.0)
    frame, = assembler.feed(*FIRST[1], 11.0)
    assert before.values.tolist() == [[1, 2], [0x63, 0x63], [5, 6], [7, 8]] and before.stamp == 0.0
    assert frame.values.tolist() == [[1, 2], [3, 4], [5, 6], [7, 8]] and frame.stamp == 10.0


def test_a_whole_sweep_after_a_silent_period_does_not_go_back_before_a_lost_sync_may_show(assembler):
    """Node 1 omits sweep 1, and the driver does not receive SYNC 3.

    The driver must not join sweep 2 of node 1 with sweep 1 of node 5.
    """
    assembler.sync(0.0)
    feed(assembler, *FIRST, *SECOND)
    given = [*assembler.sync(10.0)]
    for can_id, data in SECOND:
        given += assembler.feed(can_id, data, 11.0)
    given += assembler.sync(20.0)
    sweep = [tpdo for pair in zip(FIRST, SECOND) for tpdo in pair]
    for can_id, data in (*sweep, *sweep):  # The CAN frames of sweeps 2 and 3 follow.
        given += assembler.feed(can_id, bytes(len(data)), 21.0)
    given += assembler.sync(40.0)
    for frame in (result for result in given if not isinstance(result, Loss)):
        values = frame.values[~np.isnan(frame.values)]
        assert not ((values == 0).any() and (values != 0).any()), frame


def test_it_is_dropped_when_that_node_begins_none(assembler):
    assembler.sync(0.0)
    feed(assembler, FIRST[0], *SECOND)
    assembler.sync(10.0)
    feed(assembler, (0x281, b'\x63\x63'), *SECOND, at=11.0)
    before, *late = assembler.sync(20.0)
    assert before.values[0].tolist() == [1, 2] and np.isnan(before.values[1]).all()
    assert Loss(LossReason.LATE, 1) in late


def test_nothing_goes_back_to_a_period_in_which_a_sync_was_lost(assembler):
    """The driver lags behind the bus and therefore notices the lost SYNC late."""
    assembler.sync(0.0)
    feed(assembler, FIRST[0], at=1.0)
    assembler.sync(10.0)
    frame, torn = assembler.feed(0x181, bytes(2), 6.0)  # This CAN frame belongs to the sweep after the lost SYNC.
    assert np.isnan(frame.values).all() and torn == Loss(LossReason.LATE, 2)
    assert feed(assembler, *SECOND, SECOND[0], at=12.0) == Loss(LossReason.LATE, 2)
    after = feed(assembler, SECOND[1], *FIRST, at=12.0)
    assert after.sequence == 1 and after.missing_can_frames == 0


@pytest.mark.parametrize('second', [(), SECOND[:1], SECOND[1:]], ids=['all lost', 'end lost', 'begin lost'])
def test_a_lost_sync_never_mixes_two_periods_of_two_nodes(assembler, second):
    """After FIRST and a part of SECOND, both nodes send the next sweeps without a SYNC in between."""
    old = [(can_id, bytes(len(data))) for can_id, data in (*FIRST, *second)]
    assembler.sync(0.0)
    feed(assembler, *old)
    assert feed(assembler, *FIRST, *SECOND) == Loss(LossReason.LATE)
    frame = only(assembler.sync(1.0))
    assert np.isnan(frame.values).all() and frame.missing_can_frames == 4
    counts = assembler.facts()
    assert counts.tpdos_received == counts.losses[LossReason.LATE] == 6 + len(second)
    assert feed(assembler, *FIRST, *SECOND).values.tolist() == [[1, 2], [3, 4], [5, 6], [7, 8]]


@pytest.mark.parametrize(('text', 'says'), [
    (TWO.replace('nodes: 2', 'nodes: 3'), 'none with node: 2'), (TWO.replace('nodes: 2\n', ''), r'tpdos\[2\].node'),
    (TWO.replace('node: 1, number: 2', 'node: 1, number: 1'), r'tpdos\[3\].number'),
    (TWO.replace('nodes: 2', 'nodes: 0'), '"nodes"')])
def test_bad_layouts_are_refused(tmp_path, text, says):
    with pytest.raises(ConfigurationError, match=says):
        tiny_layout(tmp_path, text)


def test_node_ids_are_shared_out_in_order():
    def shared(layouts, node_ids):
        return [(pad.name, pad.node_ids) for pad in make_pads(layouts, node_ids)]

    assert shared([LAYOUT, 'sim16x16.yaml'], [32, 35, 64]) == [('pad32', (32, 35)), ('pad64', (64,))]
    assert shared([LAYOUT], [32, 35, 64, 67]) == [('pad32', (32, 35)), ('pad64', (64, 67))]
    with pytest.raises(ConfigurationError, match=r'2 \+ 1 node-IDs'):
        shared([LAYOUT, 'sim16x16.yaml'], [32, 64])


def test_names_say_how_many_pads_there_are():
    assert [pad.name for pad in make_pads(['sim16x16.yaml'], [32, 64], ['left', 'right'])] == ['left', 'right']
    with pytest.raises(ConfigurationError, match=r'1 \+ 1 node-IDs'):
        make_pads(['sim16x16.yaml'], [32], ['left', 'right'])
    with pytest.raises(ConfigurationError, match='layouts: expected one value'):
        make_pads(['sim16x16.yaml'] * 2, [32, 33, 34], ['left', 'right', 'third'])


def test_nodes_that_cannot_share_a_bus(tmp_path):
    layout = tiny_layout(tmp_path, TWO)
    for node_ids, says in (((1, 1), 'a different node-ID'), ((1,), '2 node-IDs'), ((1, 128), 'node-ID 1..127')):
        with pytest.raises(ConfigurationError, match=says):
            check_pads((PadSettings('pad', node_ids, layout),))
