"""Row-multiplexed TPDOs and MPDOs: hand-written bytes, followed by an end-to-end test with the simulated skin."""

import re

import numpy as np
import pytest
from can_bench import Loss, only, telling, tiny_layout

from tactile_node.assembly.facts import LossReason
from tactile_node.assembly.sync_assembler import SyncAssembler
from tactile_node.errors import ConfigurationError
from tactile_node.skin.layout_file import load_layout
from tactile_node.taxel_frame import TaxelStatus

ROWS = '''
rows: 2
cols: 3
pitch: 0.004
value: {unit: Pa, scale: 1.0, bits: 8}
tpdos:
- {number: 1, cob_id: 0x190, rows: {first: 7, count: 2, step: [1, 0]}, map: {object: 0x2200, sub: 1, bits: 8, count: 4},
   taxels: {first: [0, 0], step: [0, 1], count: 3, start_bit: 8, bit_step: 8}}
'''
MPDO = '''
rows: 2
cols: 2
pitch: 0.004
value: {unit: N, scale: 0.5, bits: 16, signed: true}
tpdos:
- {number: 1, cob_id: 0x190, mpdo: {object: 0x2155, sub: 3, count: 2, step: [1, 0]},
   taxels: {first: [0, 0], step: [0, 1], count: 2, start_bit: 32, bit_step: 16}}
'''


def feed(assembler, can_id, *frames):
    return only([assembler.feed(can_id, bytes.fromhex(data), 0.5) for data in frames][-1])


def test_rows_by_hand(tmp_path):
    assembler = telling(SyncAssembler(tiny_layout(tmp_path, ROWS), (1,)))
    assembler.sync(0)
    assert feed(assembler, 0x190, '07010203') is None
    frame = feed(assembler, 0x190, '08040506')
    assert frame.values.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_ten_bits_packed_and_falling_by_hand():
    """Row 3 has the counts 1023, 341, 1023, 1023 and 1023, packed with the least significant bit first.

    The second taxel reads 100 (1023 - 341) Pa.
    """
    assembler = telling(SyncAssembler(load_layout('rows12x5_10bit.yaml'), (5,)))
    assembler.sync(0)
    for row in range(12):
        frame = feed(assembler, 0x185, f'{row:02X}' + ('FF57F5FFFFFF03' if row == 3 else 'FFFFFFFFFFFF03'))
    wanted = np.zeros((12, 5))
    wanted[3, 1] = 68200
    np.testing.assert_array_equal(frame.values, wanted)


def test_mpdos_by_hand(tmp_path):
    """The message is sent by node 5.

    In byte 0, bit 7 is clear and the other bits are the node-ID. The next bytes are 0x2155 in little-endian order, the
    sub-index, and two signed counts.
    """
    assembler = telling(SyncAssembler(tiny_layout(tmp_path, MPDO), (5,)))
    assembler.sync(0)
    assert feed(assembler, 0x190, '05552103E80318FC') is None
    assert feed(assembler, 0x190, '05552104' '0200FEFF').values.tolist() == [[500, -500], [1, -1]]


@pytest.mark.parametrize('foreign', ['85552104' '02000300',  # destination address mode (bit 7 set)
                                     '06552104' '02000300',  # from another node
                                     '05562104' '02000300', '05552105' '02000300'])
def test_foreign_mpdos_are_counted_and_leave_their_taxels_stale(tmp_path, foreign):
    assembler = telling(SyncAssembler(tiny_layout(tmp_path, MPDO), (5,)))
    assembler.sync(0)
    feed(assembler, 0x190, '05552103' '01000100')
    assert feed(assembler, 0x190, foreign) == Loss(LossReason.UNKNOWN_ROW)
    frame = only(assembler.end_period())
    assert frame.status.tolist() == [[TaxelStatus.VALID] * 2, [TaxelStatus.STALE] * 2]
    assert np.isnan(frame.values[1]).all() and frame.missing_can_frames == 1


@pytest.mark.parametrize('data', ['', '05', '055521'])
def test_too_short_to_tell_the_object(tmp_path, data):
    assembler = telling(SyncAssembler(tiny_layout(tmp_path, MPDO), (5,)))
    assembler.sync(0)
    assert feed(assembler, 0x190, data) == Loss(LossReason.SHORT)


BAD = {
    'row number over a byte': (ROWS.replace('first: 7', 'first: 255'), 'key "tpdos[0].rows.count"'),
    'sub-index over a byte': (MPDO.replace('sub: 3', 'sub: 254'), 'key "tpdos[0].mpdo.count"'),
    'map beside MPDOs': (MPDO.replace('mpdo:', 'map: [[0x2000, 1, 8]], mpdo:'), 'key "tpdos[0].map"'),
    'rows beside MPDOs': (MPDO.replace('mpdo:', 'rows: {count: 2, step: [1, 0]}, mpdo:'), 'key "tpdos[0].rows"'),
    'taxel on the row number': (ROWS.replace('start_bit: 8', 'start_bit: 0'), 'behind the 8 bits'),
    'taxel on the sub-index': (MPDO.replace('start_bit: 32', 'start_bit: 24'), 'behind the 32 bits'),
    'rows outside': (ROWS.replace('count: 2, step', 'count: 3, step'), 'taxel (2, 0)'),
    'unknown key': (MPDO.replace('sub: 3', 'sub: 3, bits: 8'), 'key "tpdos[0].mpdo.bits"'),
    'object twice': (MPDO.replace('rows: 2', 'rows: 4') + MPDO.split('tpdos:')[1].replace('[0, 0]', '[2, 0]'), 'again'),
    'plain and MPDO under one number': (MPDO.replace('rows: 2', 'rows: 3')
                                        + '- {number: 1, cob_id: 0x191, map: [[0x2000, 1, 16]], taxels: [[2, 0, 0]]}',
                                        'tpdos[1].number'),
    'plain and MPDO under one COB-ID': (MPDO.replace('rows: 2', 'rows: 3')
                                        + '- {number: 2, cob_id: 0x190, map: [[0x2000, 1, 16]], taxels: [[2, 0, 0]]}',
                                        'tpdos[1].cob_id')}


@pytest.mark.parametrize(('text', 'says'), BAD.values(), ids=BAD)
def test_bad_layouts_are_refused(tmp_path, text, says):
    with pytest.raises(ConfigurationError, match=re.escape(says)):
        tiny_layout(tmp_path, text)
