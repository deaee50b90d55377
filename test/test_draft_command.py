"""`tactile draft`: from an EDS to a layout that loads, with every guess marked."""

from pathlib import Path

import pytest

from tactile_node.cli.main import main
from tactile_node.skin.layout_file import read_layout

CONFIG = Path(__file__).parents[1] / 'config'

PART = '[{index:X}{sub}]\nParameterName=x{index:X}{sub}\nDataType={kind}\nAccessType=rw\n{default}'


def record(index, subs):
    """Sections of a record; ``subs``: sub-index -> (data type, default or None)."""
    lines = f'[{index:X}]\nParameterName=x{index:X}\nObjectType=9\nSubNumber={len(subs)}\n'
    return lines + ''.join(PART.format(index=index, sub=f'sub{sub:X}', kind=kind,
                                       default='' if default is None else f'DefaultValue={default}\n')
                           for sub, (kind, default) in subs.items())


def tpdo(number, cob_id, entries, count=None):
    entries = dict(enumerate(entries, 1))
    return record(0x1800 + number - 1, {0: (5, 2), 1: (7, cob_id), 2: (5, 255)}) \
        + record(0x1A00 + number - 1, {0: (5, len(entries) if count is None else count)}
                 | {sub: (7, entry) for sub, entry in entries.items()})


#: a status byte before three signed taxels; a TPDO without a COB-ID; one that is disabled, for a fixed node-ID;
#: one that maps only a status, one that maps nothing, one whose third object has no default
EDS = '[DeviceInfo]\nVendorName=x\n' + record(0x2000, {0: (5, 9)} | {sub: (3, 0) for sub in range(1, 10)}) \
    + record(0x2001, {0: (5, 1), 1: (5, 0)}) \
    + tpdo(1, '$NODEID+0x40000180', ['0x20010108', '0x20000110', '0x20000210', '0x20000310']) \
    + tpdo(2, None, ['0x20000410', '0x20000510']) + tpdo(3, '0xC00003A5', ['0x20000610', '0x20000710']) \
    + tpdo(4, '$NODEID+0x480', ['0x20010108']) + tpdo(5, '$NODEID+0x80000000', []) \
    + tpdo(6, '$NODEID+0x190', ['0x20000810', '0x20000910', None])


def drafted(folder, eds, *words):
    """Return exit code and path of the draft."""
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


def test_what_the_eds_does_not_say_is_marked(tmp_path, capsys):
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
    """A scale of 1 Pa is a pressure that looks right."""
    _, path = drafted(tmp_path, 'sim16x16.eds')
    assert main(['check', str(path), 'sim16x16.eds']) == 2
    out = capsys.readouterr().out
    numbers = [str(number) for number, line in enumerate(path.read_text().splitlines(), 1) if '# FILL IN' in line]
    assert len(numbers) == 4 and f'lines {", ".join(numbers)}' in out and 'key "pitch"' in out
    text = path.read_text().replace('# FILL IN', '#').replace('pitch: 1.0', 'pitch: 0.002')
    path.write_text(text)
    assert main(['check', str(path), 'sim16x16.eds']) == 0


@pytest.mark.parametrize('is_link', [False, True])
def test_a_file_that_exists_is_never_overwritten(is_link, tmp_path, capsys):
    path = tmp_path / 'draft.yaml'
    path.symlink_to(tmp_path / 'elsewhere') if is_link else path.write_text('kept')
    code, _ = drafted(tmp_path, 'sim16x16.eds')
    assert code == 2 and not (tmp_path / 'elsewhere').exists() and (is_link or path.read_text() == 'kept')


def test_it_says_what_was_written_and_what_to_do(tmp_path, capsys):
    _, path = drafted(tmp_path, 'sim16x16.eds')
    assert f'tactile check {path} sim16x16.eds' in capsys.readouterr().out


def test_without_a_file_it_is_printed(tmp_path, capsys):
    assert main(['draft', 'sim8x8_16bit.eds']) == 0
    path = tmp_path / 'x.yaml'
    path.write_text(capsys.readouterr().out)
    assert read_layout(path).rows == 8


@pytest.mark.parametrize('words', [
    ('domain16x10_16bit.eds',), ('mpdo8x8_16bit.eds',), ('nus_sinapse_64x64.eds',),  # 64 bits: no taxel is as wide
    ('sim16x16.eds', '--rows', '15', '--cols', '17'), ('sim16x16.eds', '--rows', '0'), ('sim16x16.eds', '--bits', '33'),
    ('sim16x16.eds', '--cols', '2000'), ('nowhere.eds',), ('sim16x16.yaml',)])
def test_what_cannot_be_a_draft_is_refused(words, capsys):
    assert main(['draft', *words]) == 2
    out = capsys.readouterr()
    assert not out.out and 'expected' in out.err
