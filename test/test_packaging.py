"""What is stated in two places agrees: versions of the package and of what it needs."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

import tactile_node
from tactile_node import package_files

ROOT = Path(__file__).resolve().parents[1]


def test_the_version_is_that_of_package_xml():
    version = ElementTree.parse(ROOT / 'package.xml').findtext('version')
    assert tactile_node.__version__ == version


def test_the_lowest_versions_that_are_tested_are_those_that_setup_cfg_allows():
    setup = (ROOT / 'setup.cfg').read_text(encoding='utf-8')
    allowed = set(re.findall(r'([\w-]+) >= ([\d.]+)', setup))
    tested = set(re.findall(r'^([\w-]+)==([\d.]+)$', (ROOT / 'requirements/lowest.txt').read_text(), re.MULTILINE))
    assert len(allowed) == 14
    assert allowed <= tested
    assert {name for name, _ in tested} - {name for name, _ in allowed} == {'pytest', 'pytest-cov', 'setuptools',
                                                                            'py-trees', 'jsonschema'}


LOCKS = 'lock.txt', 'lock_kilted.txt'


@pytest.mark.parametrize('name', LOCKS)
def test_every_package_of_the_lock_has_the_hashes_of_its_files(name):
    """Else pip would take whatever the index gives under that version."""
    lock = (ROOT / 'requirements' / name).read_text(encoding='utf-8')
    packages = re.split(r'^(?=[\w-]+==)', lock, flags=re.MULTILINE)[1:]
    assert len(packages) > 150
    for package in packages:
        assert re.search(r' \\\n    --hash=sha256:[0-9a-f]{64}\b', package), package
    assert 'http' not in lock and 'index-url' not in lock


@pytest.mark.parametrize('distribution', ['tactile_skin', 'tactile_node'])  # pip's name, ament's name
def test_an_installation_has_the_version_of_its_own_metadata(distribution, tmp_path, monkeypatch):
    info = tmp_path / f'{distribution}-7.8.9.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {distribution}\nVersion: 7.8.9\n', encoding='utf-8')
    monkeypatch.setattr(package_files, 'is_checkout', lambda: False)
    monkeypatch.setattr(package_files, 'PACKAGE_FOLDER', tmp_path / 'tactile_node')
    assert package_files.package_version() == '7.8.9'


def test_without_metadata_the_version_is_unknown_and_not_that_of_another_installation(tmp_path, monkeypatch):
    monkeypatch.setattr(package_files, 'is_checkout', lambda: False)
    monkeypatch.setattr(package_files, 'PACKAGE_FOLDER', tmp_path / 'tactile_node')
    assert package_files.package_version() == 'unknown'
