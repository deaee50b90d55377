"""No command replaces an existing file without the option --force.

Before a command starts its work, it refuses to overwrite an existing file.
"""

import argparse
import io
import os

import numpy as np
import pytest
from test_can_commands import DATA

from tactile_node.cli.main import COMMANDS, _parser, main

LOG = str(DATA / 'sim16x16_two_pads.log.gz')
RECORD = ['record', '--interface', 'virtual', '--duration', '0.1', 'x.log']
#: Commands that write one file, whose name is their last argument. The inputs and the bus do not exist, so each command
#: must refuse to overwrite the file before it looks for them.
WRITES = [
    ['features', 'none.npy', '-o', 'x.json'], ['classify', 'none.npy', '-o', 'x.json'],
    ['calibrate', 'none.npz', '--radius', '0.01', '-o', 'x.yaml'],
    ['teach', '--name', 'plug', '--from', 'none.npy', '-o', 'x.npz'],
    ['teach', '--name', 'plug', '--from', 'none.npy', '-o', 'new.npz', '--picture', 'x.png'],
    ['draft', 'sim16x16.eds', '--output', 'x.yaml'], RECORD,
    ['replay', 'none.log', '-o', 'x.npz'], ['report', 'none.log', '-o', 'x.html']]
#: Commands without --force. The option --report or --record of the first two appends to a file or numbers its files.
#: `tactile commission` replaces only files that an earlier run of it has written.
REPLACES_NO_OTHER_FILE = {'simulate', 'bringup', 'commission'}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refuses(words, path, capsys):
    path.parent.mkdir(exist_ok=True)
    path.write_text('kept')
    assert main(words) == 2
    error = capsys.readouterr().err
    return path.name in error or path.parent.name in error, '--force' in error, path.read_text() == 'kept'


@pytest.mark.parametrize('words', WRITES, ids=lambda words: f'{words[0]} {words[-1]}')
def test_a_file_that_exists_is_refused_before_the_work(words, folder, capsys):
    assert all(refuses(words, folder / words[-1], capsys))
    assert os.listdir(folder) == [words[-1]]


def test_a_file_of_one_of_several_pads_or_of_a_series_is_refused(folder, capsys):
    assert all(refuses(['replay', LOG, '--node-id', '32,64', '-o', 'x.npz'], folder / 'x_pad64.npz', capsys))
    assert all(refuses(RECORD, folder / 'x_part2.log', capsys))


@pytest.mark.slow
def test_with_force_it_is_replaced(folder, capsys):
    for name in ('x.npz', 'x.jsonl', 'x.yaml', 'x.log', 'x_part2.log'):
        (folder / name).write_text('old')
    assert main(['replay', LOG, '-o', 'x.npz', '--force']) == 0 and 'values' in np.load('x.npz')
    assert main(['classify', 'x.npz', '-o', 'x.jsonl', '--force']) == 0
    assert main(['draft', 'sim16x16.eds', '--output', 'x.yaml', '--force']) == 0
    main([*RECORD, '--force'])
    assert all((folder / name).read_text() != 'old' for name in ('x.jsonl', 'x.yaml', 'x.log'))
    assert not (folder / 'x_part2.log').exists(), 'a reader would take this file for a part of the new recording'


def test_a_log_with_an_unknown_suffix_is_kept(folder):
    (folder / 'thesis.txt').write_text('kept')
    assert main(['record', '--interface', 'virtual', 'thesis.txt', '--force']) == 2
    assert (folder / 'thesis.txt').read_text() == 'kept'


@pytest.mark.parametrize('name', ['parameters.yaml', 'report.md', 'report.json', 'check.json'])
def test_a_folder_without_a_record_keeps_its_files(folder, name, monkeypatch, capsys):
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    monkeypatch.setattr('sys.stdin', terminal)
    (folder / name).write_text('kept')
    assert main(['commission', '--output', str(folder), '--joint', 'finger', '--unit', 'm', '--limits', '0', '0.04',
                 '--most-effort', '40']) == 2
    assert (folder / name).read_text() == 'kept' and 'another folder' in capsys.readouterr().err


def test_a_device_does_not_count_as_an_existing_file(folder):
    assert main(['draft', 'sim16x16.eds', '--output', os.devnull]) == 0


@pytest.mark.parametrize('command', [name for name, *_ in COMMANDS])
def test_every_command_that_writes_a_file_has_force_or_never_overwrites(command):
    parsers = next(action for action in _parser(command)._actions if isinstance(action, argparse._SubParsersAction))
    options = {option for action in parsers.choices[command]._actions for option in action.option_strings}
    writes = options & {'--output', '--report', '--record', '--picture'} or command == 'record'
    assert bool(writes) == ('--force' in options or command in REPLACES_NO_OTHER_FILE)
