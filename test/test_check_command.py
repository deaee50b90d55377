"""`tactile check`: all problems of a layout and its EDS in one run, with their lines."""

import json
from pathlib import Path

import pytest
from long_layouts import written_out

from tactile_node.cli.main import main

CONFIG = Path(__file__).parents[1] / 'config'
LAYOUTS = sorted(path.name for path in CONFIG.glob('*.yaml') if path.with_suffix('.eds').exists())
SIM = (CONFIG / 'sim16x16.yaml').read_text(encoding='utf-8')
LONG = written_out(SIM, 'sim16x16')


def check(capsys, *words):
    """Return exit code and what was printed."""
    code = main(['check', *map(str, words)])
    return code, capsys.readouterr().out


def written(folder, text):
    path = folder / 'skin.yaml'
    path.write_text(text, encoding='utf-8')
    return path


def line_with(text, part):
    """Number of the first line that has ``part``."""
    return next(number for number, line in enumerate(text.splitlines(), 1) if part in line)


@pytest.mark.parametrize('layout', LAYOUTS)
def test_the_shipped_layouts_have_no_problem(layout, capsys):
    code, out = check(capsys, layout)
    assert code == 0 and 'errors: 0, warnings: 0' in out and len(LAYOUTS) >= 6


def test_every_problem_is_reported_with_its_line(tmp_path, capsys):
    text = (LONG.replace('first: [0, 0]', 'first: [0, 12]').replace('number: 2,', 'number: 1,')
            .replace('sync_cob_id: 0x080', 'sync_cob_id: 0x701').replace('dead_taxels: []', 'dead_taxels: [[99, 0]]'))
    code, out = check(capsys, written(tmp_path, text), CONFIG / 'sim16x16.eds', '--json')
    errors = json.loads(out)['errors']
    assert code == 2
    found = {error['where'].split('"')[1]: error['line'] for error in errors}
    first = line_with(text, 'first: [0, 12]')
    assert found == {'tpdos[0].taxels': first, 'tpdos[1].taxels': first + 2, 'tpdos[1].number': first + 1,
                     'sync_cob_id': line_with(text, '0x701'), 'dead_taxels': line_with(text, '[[99, 0]]')}
    assert all(error['expected'] and error['got'] and error['remedy'] for error in errors)


def test_a_tpdo_that_is_too_long_is_an_error_like_others(tmp_path, capsys):
    text = SIM.replace('bits: 8, count: 8}', 'bits: 8, count: 20}', 1)
    code, out = check(capsys, written(tmp_path, text), CONFIG / 'sim16x16.eds')
    assert code == 2 and '160 bits' in out


def test_a_layout_and_an_eds_that_disagree_are_compared_to_their_end(capsys):
    code, out = check(capsys, 'sim16x16.yaml', CONFIG / 'rows12x5_10bit.eds', '--json')
    assert code == 2 and len(json.loads(out)['errors']) > 32


def test_facts_of_the_bus_are_those_of_can(capsys):
    """A frame of 8 bytes has 111 bits and up to 24 stuff bits (CiA 301 names neither: ISO 11898-1), SYNC 55 at most."""
    _, out = check(capsys, 'sim16x16.yaml', '--json', '--bitrate', '500000')
    found = json.loads(out)
    assert found['sweep_bits'] == 32 * (111 + 24) + 47 + 8
    assert found['highest_sweep_rate'] == pytest.approx(500_000 / 4375)
    assert found['load']['50 Hz'] == pytest.approx(0.4375)


def test_what_is_mapped_nowhere_is_a_warning(tmp_path, capsys):
    text = SIM.replace('rows: 16', 'rows: 17', 1).replace('dead_taxels: []', 'dead_taxels: [[3, 1]]')
    path = written(tmp_path, text)
    code, out = check(capsys, path, CONFIG / 'sim16x16.eds')
    assert code == 1 and '16 of 272 taxels are in no TPDO, the first is row 16, column 0' in out
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


def test_a_bit_rate_that_is_none_is_refused(capsys):
    assert main(['check', 'sim16x16.yaml', '--bitrate', '0']) == 2


def test_without_sync_the_load_is_that_of_the_event_timer(capsys):
    """16 frames of 8 bytes each 50 ms, 135 bits each; a sweep has no SYNC."""
    code, out = check(capsys, 'event8x8_16bit.yaml', '--json')
    found = json.loads(out)
    assert code == 0 and found['event_driven'] and found['sweep_bits'] == 16 * 135
    assert found['load'] == {'20 Hz': pytest.approx(16 * 135 / 1e6 / 0.05)}


def test_a_sweep_without_sync_must_fit_into_its_time(capsys):
    """At 125 kbit/s 12 frames of 135 bits take 13 ms of the 20 ms between two sweeps."""
    code, out = check(capsys, 'event12x8_8bit.yaml', '--bitrate', '125000')
    assert code == 1 and 'takes 13.0 ms, and 9.0 ms are left' in out


@pytest.mark.parametrize('pads, period, load, warns', [
    (4, 0.02, 0.86675, False), (2, 0.01, 0.8695, False), (3, 0.01, 1.3015, True), (5, 0.02, 1.08275, True)])
def test_several_pads_on_one_bus_share_its_time(pads, period, load, warns, capsys):
    """ISO 11898-1: 135 bits a frame of 8 bytes, 55 of SYNC at most; 4 pads: 50 x (55 + 4 x 32 x 135) = 866.75 kbit/s.

    The one SYNC of a period is of all pads.
    """
    code, out = check(capsys, 'sim16x16.yaml', '--pads', pads, '--sync-period', period, '--json')
    found = json.loads(out)
    assert found['pads'] == pads and found['load'][f'{1 / period:g} Hz'] == pytest.approx(load)
    assert found['highest_sweep_rate'] == pytest.approx(1 / (load * period))
    assert code == warns and len(found['warnings']) == warns


@pytest.mark.parametrize('words', [('--pads', '0'), ('--sync-period', '0'), ('--sync-period', 'nan')])
def test_a_use_that_is_none_is_refused(words):
    assert main(['check', 'sim16x16.yaml', *words]) == 2
