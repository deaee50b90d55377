"""`tactile fit` writes a user's curves: never over the published ones, over others only with --force."""

import os
import shutil
from pathlib import Path

import pytest

from tactile_node import package_files
from tactile_node.cli import fit
from tactile_node.cli.main import main

ROOT = Path(__file__).resolve().parents[1]
SHIPPED = ROOT / 'config' / 'volf_curves.yaml'


class TooFarError(Exception):
    """The output was accepted, and patterns would be drawn."""


@pytest.fixture(autouse=True)
def no_work(monkeypatch):
    def draw(*arguments):
        raise TooFarError
    monkeypatch.setattr(fit, '_draw', draw)


def linked(tmp_path):
    (tmp_path / 'link.yaml').symlink_to(SHIPPED)
    return tmp_path / 'link.yaml'


def through_a_folder(tmp_path):
    (tmp_path / 'folder').symlink_to(SHIPPED.parent)
    return tmp_path / 'folder' / SHIPPED.name


def by_a_roundabout_way(tmp_path):
    return SHIPPED.parent / '..' / 'config' / SHIPPED.name


def of_another_checkout(tmp_path):
    (tmp_path / 'src' / 'config').mkdir(parents=True)
    for name in ('package.xml', 'config/volf_curves.yaml'):
        shutil.copy(ROOT / name, tmp_path / 'src' / name)
    return tmp_path / 'src' / 'config' / 'volf_curves.yaml'


def of_a_wheel(tmp_path):
    installed = tmp_path / 'site-packages' / 'tactile_node'
    (installed / 'config').mkdir(parents=True)
    shutil.copy(package_files.__file__, installed)
    shutil.copy(SHIPPED, installed / 'config')
    return installed / 'config' / SHIPPED.name


@pytest.mark.parametrize('force', [(), ('--force',)])
@pytest.mark.parametrize('path', [
    lambda folder: SHIPPED, linked, through_a_folder, by_a_roundabout_way, of_another_checkout, of_a_wheel,
    lambda folder: ROOT / 'config' / 'recogniser.npz'])
def test_a_file_of_the_package_is_never_overwritten(tmp_path, path, force, capsys):
    output = path(tmp_path)
    before = output.read_bytes()
    assert main(['fit', '--output', str(output), *force]) == 2
    assert output.read_bytes() == before and capsys.readouterr().err.count('\n') == 1


def test_another_file_is_overwritten_on_request_only(tmp_path):
    mine = tmp_path / 'volf_curves.yaml'
    mine.write_text('mine')
    assert main(['fit', '--output', str(mine)]) == 2
    with pytest.raises(TooFarError):
        main(['fit', '--output', str(mine), '--force'])
    assert mine.read_text() == 'mine'


def test_a_new_file_is_written_also_in_a_folder_called_config(tmp_path):
    (tmp_path / 'config').mkdir()
    with pytest.raises(TooFarError):
        main(['fit', '--output', str(tmp_path / 'config' / 'mine.yaml')])


def test_without_an_option_it_is_a_file_of_the_current_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TooFarError):
        main(['fit'])
    (tmp_path / 'volf_curves.yaml').write_text('mine')
    assert main(['fit']) == 2


def test_what_cannot_be_written_is_refused_before_the_work(tmp_path):
    assert main(['fit', '--output', str(tmp_path / 'no' / 'x.yaml')]) == 2
    assert os.listdir(tmp_path) == []
