"""Tests that `tactile check` reports all problems of a layout by line and that `tactile draft` writes a layout."""

import json
import textwrap
from pathlib import Path

import pytest
from eds_text import record

from tactile_node.cli.main import main
from tactile_node.skin.layout_file import read_layout
from tactile_node.skin.pads import make_pad

CONFIG = Path(__file__).parents[1] / 'config'
LAYOUTS = sorted(path.name for path in CONFIG.glob('*.yaml') if path.with_suffix('.eds').exists())
SIM = (CONFIG / 'sim16x16.yaml').read_text(encoding='utf-8')
#: The first two TPDOs of the layout, written without ``repeat``.
TWO = SIM[:SIM.index('tpdos:\n')] + '''tpdos:
- {number: 1, cob_id: $NODEID+0x180, map: {object: 0x2100, sub: 1, bits: 8, count: 8},
   taxels: {first: [0, 0], step: [0, 1], count: 8, bit_step: 8}}
- {number: 2, cob_id: $NODEID+0x181, map: {object: 0x2100, sub: 9, bits: 8, count: 8},
   taxels: {first: [0, 8], step: [0, 1], count: 8, bit_step: 8}}
'''


def check(capsys, *words):
    """Run `tactile check` and return its exit code and output."""
    code = main(['check', *map(str, words)])
    return code, capsys.readouterr().out


def written(folder, text):
    path = folder / 'skin.yaml'
    path.write_text(text, encoding='utf-8')
    return path


def line_with(text, part):
    """Return the number of the first line that contains ``part``."""
    return next(number for number, line in enumerate(text.splitlines(), 1) if part in line)


@pytest.mark.parametrize('layout', LAYOUTS)
def test_the_shipped_layouts_have_no_problem(layout, capsys):
    code, out = check(capsys, layout)
    assert code == 0 and 'errors: 0, warnings: 0' in out and len(LAYOUTS) >= 6


def test_every_problem_is_reported_with_its_line(tmp_path, capsys):
    text = (TWO.replace('first: [0, 0]', 'first: [0, 12]').replace('number: 2,', 'number: 1,')
            .replace('sync_cob_id: 0x080', 'sync_cob_id: 0x701').replace('dead_taxels: []', 'dead_taxels: [[99, 0]]'))
    code, out = check(capsys, written(tmp_path, text), CONFIG / 'sim16x16.eds', '--json')
    errors = json.loads(out)['errors']
    assert code == 2
    found = {error['where'].split('"')[1]: error['line'] for error in errors}
    first = line_with(text, 'first: [0, 12]')
    assert found == {'tpdos[0].taxels': first, 'tpdos[1].taxels': first + 2, 'tpdos[1].number': first + 1,
                     'sync_cob_id': line_with(text, '0x701'), 'dead_taxels': line_with(text, '[[99, 0]]')}
    assert all(error['expected'] and error['got'] and error['remedy'] for error in errors)


def test_a_layout_and_an_eds_that_disagree_are_compared_to_their_end(capsys):
    code, out = check(capsys, 'sim16x16.yaml', CONFIG / 'rows12x5_10bit.eds', '--json')
    assert code == 2 and len(json.loads(out)['errors']) > 32


def test_one_wrong_count_gives_the_first_errors_of_a_kind_and_how_many_more_there_are(tmp_path, capsys):
    """The layout has eight TPDOs too many, for rows 16 to 19.

    Each extra TPDO lies outside the pad, and the EDS lacks two records and one object for it.
    """
    path = written(tmp_path, SIM.replace('count: 4, number: 8', 'count: 5, number: 8'))
    code, out = check(capsys, path, CONFIG / 'sim16x16.eds')
    lines = [line for line in out.splitlines() if line.startswith('ERROR')]
    more = {line.split(': ', 2)[2]: int(line.split()[1])
            for line in lines if 'more with this remedy' in line}
    assert code == 2 and 'errors: 32,' in out
    assert more == {'Correct the taxel, or rows and cols.': 5, 'Correct "map", or use the EDS that belongs to this '
                    'skin.': 5, 'Correct the TPDO number, or use the EDS that belongs to this skin.': 13}
    shown = [line for line in lines if 'more with' not in line]
    assert len(shown) == 32 - 23 and 'TPDO 33' in shown[0] and 'TPDO 34' in shown[1] and 'TPDO 35' in shown[2]
    assert len(json.loads(check(capsys, path, CONFIG / 'sim16x16.eds', '--json')[1])['errors']) == 32


def test_facts_of_the_bus_are_those_of_can(capsys):
    """A data frame of 8 bytes has 111 bits and up to 24 stuff bits, and a SYNC has at most 55 bits.

    These frame lengths come from ISO 11898-1, because CiA 301 does not state them.
    """
    _, out = check(capsys, 'sim16x16.yaml', '--json', '--bitrate', '500000')
    found = json.loads(out)
    assert found['sweep_bits'] == 32 * (111 + 24) + 47 + 8
    assert found['highest_sweep_rate'] == pytest.approx(500_000 / 4375)
    assert found['load']['50 Hz'] == pytest.approx(0.4375)


def test_the_sides_at_which_the_finger_ends_are_named(tmp_path, capsys):
    path = written(tmp_path, SIM.replace('finger_ends: []', 'finger_ends: [last_col, first_row]'))
    _, out = check(capsys, path, CONFIG / 'sim16x16.eds', '--json')
    assert json.loads(out)['finger_ends'] == ['first_row', 'last_col']
    assert 'ends together with the skin at: first_row, last_col;' in check(capsys, path, CONFIG / 'sim16x16.eds')[1]
    assert 'ends together with the skin at: no side;' in check(capsys, 'sim16x16.yaml')[1]


def test_taxels_in_no_tpdo_cause_a_warning(tmp_path, capsys):
    text = SIM.replace('rows: 16', 'rows: 17', 1).replace('dead_taxels: []', 'dead_taxels: [[3, 1]]')
    path = written(tmp_path, text)
    code, out = check(capsys, path, CONFIG / 'sim16x16.eds')
    assert code == 1 and '16 of 272 taxels are in no TPDO; the first is row 16, column 0' in out
    rows = [line for line in out.splitlines() if len(line) == 16 and set(line) <= set('#.x')]
    assert len(rows) == 17 and rows[16] == 16 * '.' and rows[3] == '#x' + 14 * '#' and rows[0] == 16 * '#'


def test_an_improbable_pitch_is_an_error_unless_it_is_meant(tmp_path, capsys):
    path = written(tmp_path, SIM.replace('pitch: 0.002', 'pitch: 2'))
    code, out = check(capsys, path, CONFIG / 'sim16x16.eds', '--json')
    error, = json.loads(out)['errors']
    assert code == 2 and error['line'] == 1 + SIM[:SIM.index('\npitch:')].count('\n') + 1 and '0.002' in error['remedy']
    path = written(tmp_path, SIM.replace('pitch: 0.002', 'unusual_pitch: true\npitch: 2'))
    assert check(capsys, path, CONFIG / 'sim16x16.eds')[0] == 0


@pytest.mark.parametrize('words, part', [
    (['nowhere.yaml'], 'nowhere.yaml'), (['sim16x16.yaml', 'nowhere.eds'], 'nowhere.eds'),
    (['sim16x16.eds'], 'YAML')])
def test_files_that_cannot_be_read_are_an_error(words, part, capsys):
    code, out = check(capsys, *words)
    assert code == 2 and 'ERROR' in out and part in out


def test_an_impossible_bit_rate_is_refused(capsys):
    assert main(['check', 'sim16x16.yaml', '--bitrate', '0']) == 2


def test_without_sync_the_load_is_that_of_the_event_timer(capsys):
    """Without SYNC, the device sends 16 frames of 8 bytes every 50 ms, and each frame takes 135 bits."""
    code, out = check(capsys, 'event8x8_16bit.yaml', '--json')
    found = json.loads(out)
    assert code == 0 and found['event_driven'] and found['sweep_bits'] == 16 * 135
    assert found['load'] == {'20 Hz': pytest.approx(16 * 135 / 1e6 / 0.05)}


@pytest.mark.parametrize('old, new, words', [
    ('bits: 16, signed: true', 'bits: 12, signed: false', '"value.bits" is 12, but object 0x7130 sub 1'),
    ('signed: true', 'signed: false', '"value.signed" is false, but in the EDS object 0x7130 sub 1'),
    ('signed: true', 'signed: true, byte_order: big', '"value.byte_order" is big, but object 0x7130 sub 1'),
    ('cob_id: 1, sub: 4', 'cob_id: 1, sub: 3', 'object 0x7130 sub 4 is mapped in tpdos[0] (TPDO 1) and')])
def test_fields_that_contradict_their_objects_are_a_warning(tmp_path, capsys, old, new, words):
    """Object 0x7130 has signed numbers of 16 bits. Two TPDOs of four objects carry each row of eight taxels."""
    written = (CONFIG / 'sim8x8_16bit.yaml').read_text(encoding='utf-8').replace('offset: 30000', 'offset: 300')
    path = tmp_path / 'layout.yaml'
    path.write_text(written.replace(old, new))
    assert old in written
    code = main(['check', str(path), 'sim8x8_16bit.eds', '--json'])
    found = json.loads(capsys.readouterr().out)
    assert code == 1 and not found['errors']
    assert [words in text for text in found['warnings']] == [True]


def test_a_live_pad_logs_these_warnings(tmp_path, caplog):
    """The driver publishes wrong values with such a layout, so its log names the cause."""
    path = tmp_path / 'layout.yaml'
    path.write_text((CONFIG / 'sim8x8_16bit.yaml').read_text(encoding='utf-8').replace(
        'signed: true', 'signed: true, byte_order: big'))
    make_pad('pad', 32, str(path), str(CONFIG / 'sim8x8_16bit.eds'))
    make_pad('right', 64, 'sim8x8_16bit.yaml')
    (record,) = caplog.records
    assert record.levelname == 'WARNING' and '"value.byte_order" is big' in record.getMessage()


ENTRY = ('- {{number: {0}, cob_id: {1}, rows: {{first: 0, count: 2, step: [1, 0]}}, '
         'map: {{object: 0x{2:X}, sub: 1, bits: 8, count: 8}},\n'
         '   taxels: {{first: [{3}, 0], step: [0, 1], count: 7, start_bit: 8, bit_step: 8}}}}\n')


@pytest.mark.parametrize(('numbers', 'more', 'warnings'), [
    ((1, 2, 3, 4), '', 0), ((1, 3, 4, 9), '', 0), ((3, 1, 4, 2), '', 1), ((1, 2, 4, 3), '', 1),
    ((3, 1, 4, 2), 'event_driven: {transmission_type: 254, event_timer: 0.05, frames: sweeps}\n', 1),
    ((3, 1, 4, 2), 'event_driven: {transmission_type: 254, event_timer: 0.05, frames: snapshots}\n', 0)])
def test_tpdos_that_are_not_in_ascending_order_are_a_warning(tmp_path, capsys, numbers, more, warnings):
    """Most devices send their TPDOs in the order of the TPDO numbers, but snapshots have no order."""
    path = tmp_path / 'order.yaml'
    entries = [ENTRY.format(number, 0x190 + number, 0x2100 + number, 2 * place) for place, number in enumerate(numbers)]
    path.write_text(f'rows: 8\ncols: 7\npitch: 0.004\nvalue: {{unit: Pa, scale: 1.0, bits: 8}}\n{more}tpdos:\n'
                    + ''.join(entries))
    code = main(['check', str(path), 'sim16x16.eds', '--json'])
    found = json.loads(capsys.readouterr().out)
    assert not found['errors'] and code == bool(warnings) and len(found['warnings']) == warnings
    assert all(', '.join(map(str, numbers)) in text for text in found['warnings'])


def test_a_sweep_without_sync_must_fit_into_its_time(capsys):
    """At 125 kbit/s, 12 frames of 135 bits take 13 ms of the 20 ms between two sweeps."""
    code, out = check(capsys, 'event12x8_8bit.yaml', '--bitrate', '125000')
    assert code == 1 and 'takes 13.0 ms, but only 9.0 ms are left' in out


@pytest.mark.parametrize('pads, period, load, warns', [
    (4, 0.02, 0.86675, False), (2, 0.01, 0.8695, False), (3, 0.01, 1.3015, True), (5, 0.02, 1.08275, True)])
def test_several_pads_on_one_bus_share_its_time(pads, period, load, warns, capsys):
    """At 50 Hz, four pads load the bus with 50 x (55 + 4 x 32 x 135) bit/s = 866.75 kbit/s.

    According to ISO 11898-1, a frame of 8 bytes takes 135 bits and a SYNC takes at most 55 bits. All pads share one
    SYNC in each period.
    """
    code, out = check(capsys, 'sim16x16.yaml', '--pads', pads, '--sync-period', period, '--json')
    found = json.loads(out)
    assert found['pads'] == pads and found['load'][f'{1 / period:g} Hz'] == pytest.approx(load)
    assert found['highest_sweep_rate'] == pytest.approx(1 / (load * period))
    assert code == warns and len(found['warnings']) == warns


@pytest.mark.parametrize('words', [('--pads', '0'), ('--sync-period', '0'), ('--sync-period', 'nan')])
def test_an_impossible_use_is_refused(words):
    assert main(['check', 'sim16x16.yaml', *words]) == 2


def tpdo(number, cob_id, entries, count=None):
    entries = dict(enumerate(entries, 1))
    return record(0x1800 + number - 1, {0: (5, 2), 1: (7, cob_id), 2: (5, 255)}) \
        + record(0x1A00 + number - 1, {0: (5, len(entries) if count is None else count)}
                 | {sub: (7, entry) for sub, entry in entries.items()})


#: EDS of a device whose TPDO 1 maps a status byte and three signed taxels. TPDO 2 has no COB-ID. TPDO 3 is disabled and
#: has a fixed COB-ID. TPDO 4 maps only the status byte, TPDO 5 maps nothing, and TPDO 6 maps a third object without a
#: default value.
EDS = '[DeviceInfo]\nVendorName=x\n' + record(0x2000, {0: (5, 9)} | {sub: (3, 0) for sub in range(1, 10)}) \
    + record(0x2001, {0: (5, 1), 1: (5, 0)}) \
    + tpdo(1, '$NODEID+0x40000180', ['0x20010108', '0x20000110', '0x20000210', '0x20000310']) \
    + tpdo(2, None, ['0x20000410', '0x20000510']) + tpdo(3, '0xC00003A5', ['0x20000610', '0x20000710']) \
    + tpdo(4, '$NODEID+0x480', ['0x20010108']) + tpdo(5, '$NODEID+0x80000000', []) \
    + tpdo(6, '$NODEID+0x190', ['0x20000810', '0x20000910', None])


def drafted(folder, eds, *words):
    """Run `tactile draft` and return its exit code and the path of the draft."""
    path = folder / 'draft.yaml'
    return main(['draft', str(eds), '--output', str(path), *map(str, words)]), path


def frames(layout):
    return [(tpdo.number, tpdo.cob_id, tpdo.mapping, tpdo.taxels) for tpdo in layout.tpdos]


@pytest.mark.parametrize(('name', 'words'), [
    ('sim16x16', ()), ('sim8x8_16bit', ()), ('nus_sinapse_64x64', ('--bits', 1)),
    ('nodes2_12x8_12bit', ('--bits', 12, '--rows', 6))])
def test_a_draft_maps_what_the_hand_written_layout_maps(name, words, tmp_path):
    code, path = drafted(tmp_path, f'{name}.eds', *words)
    ours, theirs = read_layout(path), read_layout(f'{name}.yaml').of_node(0)
    assert code == 0 and frames(ours) == frames(theirs)
    assert (ours.value.bits, ours.value.signed) == (theirs.value.bits, theirs.value.signed)
    assert ours.rows * theirs.nodes == theirs.rows and ours.cols == theirs.cols


def test_values_that_the_eds_lacks_are_marked(tmp_path, capsys):
    eds = tmp_path / 'skin.eds'
    eds.write_text(EDS)
    code, path = drafted(tmp_path, eds, '--cols', 3)
    layout, text = read_layout(path), path.read_text()
    assert code == 0 and (layout.rows, layout.cols, layout.value.bits, layout.value.signed) == (3, 3, 16, True)
    assert [(tpdo.number, str(tpdo.cob_id), [tuple(field) for field in tpdo.taxels]) for tpdo in layout.tpdos] == [
        (1, '$NODEID+0x180', [(0, 0, 8), (0, 1, 24), (0, 2, 40)]),
        (2, '$NODEID+0x280', [(1, 0, 0), (1, 1, 16)]), (3, '0x3A5', [(1, 2, 0), (2, 0, 16)]),
        (6, '$NODEID+0x190', [(2, 1, 0), (2, 2, 16)])]
    lines = text.splitlines()
    marked = {line.split(':')[0].strip(' -') for line in lines if '# GUESS' in line or '# FILL IN' in line}
    assert marked >= {'rows', 'cols', 'pitch', 'unit', 'scale', 'offset', 'bits', 'pressure', 'cob_id', 'map'}
    assert sum('cob_id' in line and 'GUESS' in line for line in lines) == 1
    assert '# TPDO 4 is left out: it maps 0x2001 sub 1 (8 bits)' in lines
    assert '# TPDO 5 is left out: it maps nothing' in lines


def test_check_refuses_a_draft_until_it_is_filled_in(tmp_path, capsys):
    """The placeholder scale of 1 Pa gives plausible pressures, so `tactile check` must refuse the draft."""
    _, path = drafted(tmp_path, 'sim16x16.eds')
    assert main(['check', str(path), 'sim16x16.eds']) == 2
    out = capsys.readouterr().out
    numbers = [str(number) for number, line in enumerate(path.read_text().splitlines(), 1) if '# FILL IN' in line]
    assert len(numbers) == 4 and f'lines {", ".join(numbers)}' in out and 'key "pitch"' in out
    text = path.read_text().replace('# FILL IN', '#').replace('pitch: 1.0', 'pitch: 0.002')
    path.write_text(text)
    assert main(['check', str(path), 'sim16x16.eds']) == 0


def test_a_link_that_exists_is_not_followed(tmp_path, capsys):
    (tmp_path / 'draft.yaml').symlink_to(tmp_path / 'elsewhere')
    assert drafted(tmp_path, 'sim16x16.eds')[0] == 2 and not (tmp_path / 'elsewhere').exists()


def test_without_a_file_it_is_printed(tmp_path, capsys):
    assert main(['draft', 'sim8x8_16bit.eds']) == 0
    path = tmp_path / 'x.yaml'
    path.write_text(capsys.readouterr().out)
    assert read_layout(path).rows == 8


@pytest.mark.parametrize('words', [
    # The 64-bit objects of nus_sinapse_64x64.eds are wider than any taxel.
    ('domain16x10_16bit.eds',), ('mpdo8x8_16bit.eds',), ('nus_sinapse_64x64.eds',),
    ('sim16x16.eds', '--rows', '15', '--cols', '17'), ('sim16x16.eds', '--rows', '0'), ('sim16x16.eds', '--bits', '33'),
    ('sim16x16.eds', '--cols', '2000'), ('nowhere.eds',), ('sim16x16.yaml',)])
def test_an_impossible_draft_is_refused(words, capsys):
    assert main(['draft', *words]) == 2
    out = capsys.readouterr()
    assert not out.out and 'expected' in out.err


def test_the_layout_on_the_page_is_whole_and_names_its_dead_taxels(tmp_path):
    page = (CONFIG.parent / 'docs' / 'howto' / 'my_skin.md').read_text(encoding='utf-8')
    text = next(part for part in page.split('```yaml\n') if part.lstrip().startswith('rows:')).split('```')[0]
    assert len(text.splitlines()) <= 25
    layout = read_layout(str(written(tmp_path, textwrap.dedent(text))))
    assert (layout.rows, layout.cols, layout.dead) == (4, 8, ((0, 3), (2, 0), (2, 1)))
    assert [[(taxel.row, taxel.col) for taxel in each.taxels] for each in layout.tpdos] == [
        [(row, col) for col in range(8)] for row in range(4)]
