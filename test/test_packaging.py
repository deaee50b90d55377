"""If two places state the version of the package or of a dependency, both must state the same version."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import make_canopen_deb
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
    """Without hashes, pip would accept any file that the index delivers under the requested version."""
    lock = (ROOT / 'requirements' / name).read_text(encoding='utf-8')
    packages = re.split(r'^(?=[\w-]+==)', lock, flags=re.MULTILINE)[1:]
    assert len(packages) > 150
    for package in packages:
        assert re.search(r' \\\n    --hash=sha256:[0-9a-f]{64}\b', package), package
    assert 'http' not in lock and 'index-url' not in lock


# pip uses the first name, and ament uses the second.
@pytest.mark.parametrize('distribution', ['tactile_skin', 'tactile_node'])
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


def test_the_canopen_of_the_install_page_is_the_pinned_one():
    pinned, = re.findall(r'^canopen==(\S+)', (ROOT / 'requirements/lock.txt').read_text(), re.MULTILINE)
    page = (ROOT / 'docs/install.md').read_text(encoding='utf-8')
    assert re.findall(r'apt install \./dist/(\S+)', page) == [f'python3-canopen_{pinned}_all.deb']


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which('dpkg-deb'), reason='dpkg-deb is not installed')
def test_the_debian_package_of_canopen_holds_all_of_it(tmp_path):
    """`make deb-test` installs the package in a clean Debian system."""
    made = make_canopen_deb.make(tmp_path)
    subprocess.run(['dpkg-deb', '--extract', made, tmp_path], check=True)
    libraries = tmp_path / 'usr/lib/python3/dist-packages'
    program = 'import canopen, importlib.metadata as m; print(m.version("canopen"), canopen.__file__)'
    out = subprocess.run([sys.executable, '-c', program], env={**os.environ, 'PYTHONPATH': str(libraries)}, check=True,
                         capture_output=True, text=True).stdout.split()
    assert out[1].startswith(str(libraries)) and made.name == f'python3-canopen_{out[0]}_all.deb'
    assert 'python3-can ' in subprocess.check_output(['dpkg-deb', '--field', made, 'Depends'], text=True)
