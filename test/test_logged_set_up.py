"""A log is never played if its setup shows another device, or TPDOs that differ from the layout.

The SDO frames are hand-written according to CiA 301 (7.2.4.3). The pad of 3 taxels maps the sub-indices 1, 2 and 3 of
object 0x2000 with 16 bits each.
"""

from functools import partial

import pytest
from can_bench import TINY, tiny_layout
from test_logs import DATA, ROWS, SYNC, play, tiny_log, tiny_pads

from tactile_node.assembly.health import BusFault
from tactile_node.cia301.objects import IDENTITY
from tactile_node.cli.main import main
from tactile_node.errors import ConfigurationError
from tactile_node.logs.logged_set_up import LoggedSetUp
from tactile_node.skin.eds_rules import Identity
from tactile_node.skin.pads import PadSettings, identities_of

SWEEP = (SYNC, *ROWS)


def upload(index, sub, value, node=1):
    """Return the request and the response of an SDO upload of 4 bytes."""
    at = f'{index & 0xFF:02X}{index >> 8:02X}{sub:02X}'
    return (f'(0.1) can0 {0x600 + node:03X}#40{at}00000000',
            f'(0.1) can0 {0x580 + node:03X}#43{at}{value.to_bytes(4, "little").hex()}')


def download(index, sub, value, answer='60', node=1):
    at = f'{index & 0xFF:02X}{index >> 8:02X}{sub:02X}'
    return (f'(0.1) can0 {0x600 + node:03X}#23{at}{value.to_bytes(4, "little").hex()}',
            f'(0.1) can0 {0x580 + node:03X}#{answer}{at}00000000')


def mapped(number, *entries, by=upload):
    lines = by(0x1A00 + number - 1, 0, len(entries))
    for sub, entry in enumerate(entries, 1):
        lines += by(0x1A00 + number - 1, sub, entry)
    return lines


RIGHT = (*mapped(1, 0x20000110), *mapped(2, 0x20000210), *mapped(3, 0x20000310),
         *upload(0x1800, 1, 0x181), *upload(0x1801, 1, 0x40000281), *upload(0x1802, 1, 0x381))


def outcome(tmp_path, *lines, **options):
    """Return the number of missing CAN frames in each taxel frame, and the player's error message."""
    frames, source = play(tiny_log(tmp_path, *lines), tiny_pads(tmp_path), **options)
    if source.failure is None:
        return [frame.missing_can_frames for _, frame in frames], ''
    assert source.failure.fault is BusFault.LOG_UNUSABLE
    return [frame.missing_can_frames for _, frame in frames], source.failure.detail


@pytest.mark.parametrize('set_up', [
    (), RIGHT, mapped(1, 0x20000110, by=download),
    # The device first had another mapping, which was then overwritten.
    (*mapped(2, 0x20000310), *mapped(2, 0x20000210, by=download)),
    # The log does not contain the response.
    (*mapped(2, 0x20000310), download(0x1A01, 1, 0x20000210)[0]),
    # The device may have restored another saved mapping.
    *((*mapped(2, 0x20000310), f'(0.2) can0 701#{boot}') for boot in ('00', '0000', '80')),
    mapped(2, 0x20000310)[1::2],  # The log contains responses without requests.
    # The device refused the write.
    (*mapped(2, 0x20000210), *download(0x1A01, 1, 0x20000310, answer='80')),
    # This write is still in the device's queue.
    (*RIGHT, *download(0x1801, 1, 0x80000281)),
    # These frames belong to another node.
    tuple(line.replace('601#', '602#').replace('581#', '582#') for line in mapped(2, 0x20000310)),
    (*mapped(9, 0x20000310), *upload(0x1808, 1, 0x80000281))])  # The device has no TPDO with this number.
def test_a_matching_or_unknown_setup_is_played(tmp_path, set_up):
    assert outcome(tmp_path, *set_up, *SWEEP) == ([0], '')


@pytest.mark.parametrize(('set_up', 'place'), [
    (mapped(2, 0x20000310), '0x1A01'),  # The mapping belongs to another row.
    (mapped(2, 0x20000208, 0x20000308), '0x1A01'),  # The TPDO maps two objects.
    (mapped(2, 0x20000310, by=download), '0x1A01'),
    (upload(0x1A01, 0, 0xFE), '0x1A01'),  # The mapping describes an MPDO.
    ((*upload(0x1800, 1, 0x281), *upload(0x1801, 1, 0x181)), '0x1800'),  # The COB-IDs are swapped.
    (download(0x1808, 1, 0x281), '0x1808')])  # TPDO 9 also uses this COB-ID.
@pytest.mark.parametrize('before', [(), SWEEP], ids=['at first', 'amid'])
def test_another_mapping_or_cob_id_is_never_played_as_the_layout_s(tmp_path, set_up, place, before):
    frames, detail = outcome(tmp_path, *before, *set_up, *SWEEP)
    assert place in detail and "Node 1 (pad 'pad')" in detail and 'layout' in detail
    assert frames[:len(before) // 4] == [0] * (len(before) // 4) and all(frames[len(before) // 4:])
    assert outcome(tmp_path, *before, *set_up, *SWEEP, any_device=True) == ([0] * (1 + len(before) // 4), '')


EDS = Identity(vendor=0x5C1, product=0x16160008, revision=0x10000)


@pytest.mark.parametrize(('sub', 'value', 'is_ours'), [
    (1, 0x5C1, True), (1, 0x5C2, False), (2, 0x16160009, False), (3, 0x10003, True), (3, 0x20000, False), (4, 7, True)])
def test_the_identity_is_compared_as_far_as_it_was_read(tmp_path, sub, value, is_ours):
    set_up = LoggedSetUp(tiny_pads(tmp_path), {'pad': EDS})
    found = [set_up.feed(int(frame[:3], 16), bytes.fromhex(frame[4:]))
             for frame in (line.split()[2] for line in upload(IDENTITY, sub, value))]
    assert found[0] is None and (found[1] is None) == is_ours
    assert is_ours or (found[1].node_id, found[1].object_index) == (1, IDENTITY)
    assert is_ours or found[1].got == f'{Identity._fields[sub - 1]} 0x{value:X}'  # nothing else was read


def test_without_an_eds_any_identity_is_played(tmp_path):
    assert identities_of(tiny_pads(tmp_path)) == {}
    assert outcome(tmp_path, *upload(IDENTITY, 1, 5), *SWEEP) == ([0], '')
    with pytest.raises(ConfigurationError, match='none.eds'):
        identities_of(tiny_pads(tmp_path), ['none.eds'])


def test_a_log_of_another_skin_is_refused_by_its_identity(tmp_path, caplog, capsys):
    """The log shows the product code 0x16160008.

    Without this check, a skin with the same number of TPDOs would have its values assigned to the wrong taxels.
    """
    log = str(DATA / 'sim16x16_two_pads.log.gz')
    assert main(['replay', log, '--layout', 'rows12x5_10bit.yaml']) != 0
    printed = capsys.readouterr()
    assert '0x1018' in printed.err + caplog.text and '0x16160008' in printed.err + caplog.text
    assert main(['replay', log]) == 0


def test_each_of_several_nodes_is_checked_against_its_own_part_of_the_layout(tmp_path):
    text = 'nodes: 2\n' + TINY.replace('{number: 3, ', '{node: 1, number: 1, ')
    pad = PadSettings('pad', (1, 2), tiny_layout(tmp_path, text))
    second = mapped(1, 0x20000310, by=partial(upload, node=2))
    lines = (*mapped(1, 0x20000110), *second, SYNC, *ROWS[:2], '(1.3) can0 382#0A0A')
    frames, source = play(tiny_log(tmp_path, *lines), (pad,))
    assert source.failure is None and [frame.missing_can_frames for _, frame in frames] == [0]


@pytest.mark.parametrize(('own', 'strangers'), [
    ('#05', {}), ('#0500', {}), ('#', {'pad': [17]}), ('#R', {'pad': [17]})])
def test_a_request_to_a_node_does_not_count_as_a_message_from_the_node(tmp_path, own, strangers):
    """A master guards node 1, but the bus has only node 17.

    One of the node's TPDOs has a COB-ID that belongs to the pad.
    """
    pad = PadSettings('pad', (1,), tiny_layout(tmp_path, TINY.replace('0x280', '0x190')))
    _, source = play(tiny_log(tmp_path, '(0.1) can0 711#05', f'(0.2) can0 701{own}', *SWEEP), (pad,))
    assert source.heard.strangers() == strangers
