"""A wheel installed outside any checkout has exactly its own files, version and types."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import tactile_node

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[1]


FOLDERS = ('tactile_node', 'config', 'msg', 'srv', 'action', 'urdf')
FILES = ('setup.py', 'setup.cfg', 'pyproject.toml', 'MANIFEST.in', 'package.xml', 'README.md', 'LICENSE', 'NOTICE',
         'CHANGELOG.rst', 'CITATION.cff', 'SECURITY.md')
BUILD = {**os.environ, 'SOURCE_DATE_EPOCH': '1735689600'}  # All archives get the same date.


@pytest.fixture(scope='module')
def source(tmp_path_factory) -> Path:
    """Copy the source, because setuptools creates its build folder inside the source folder.

    The copy contains the build folder of an earlier build.
    """
    source = tmp_path_factory.mktemp('source')
    for folder in FOLDERS:
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns('__pycache__'))
    for name in FILES:
        shutil.copy(ROOT / name, source)
    stale = source / 'build/lib/tactile_node/renamed_since.py'
    stale.parent.mkdir(parents=True)
    stale.touch()
    return source


def wheel_of(source: Path, built: Path) -> Path:
    return built_by('build_wheel', source, built)


def built_by(hook: str, source: Path, built: Path) -> Path:
    """Call a hook of setuptools as pip does, and return the built archive."""
    program = 'import sys; from setuptools import build_meta; print(getattr(build_meta, sys.argv[1])(sys.argv[2]))'
    done = subprocess.run([sys.executable, '-c', program, hook, built], cwd=source, check=True, env=BUILD,
                          capture_output=True, text=True)
    return built / done.stdout.splitlines()[-1]


@pytest.fixture(scope='module')
def wheel(source, tmp_path_factory) -> Path:
    return wheel_of(source, tmp_path_factory.mktemp('built'))


@pytest.fixture(scope='module')
def sdist(source, tmp_path_factory) -> Path:
    (source / 'test').mkdir()
    (source / 'test/test_of_half_a_suite.py').touch()  # setuptools packs this kind of file without its data.
    return built_by('build_sdist', source, tmp_path_factory.mktemp('sdist'))


@pytest.fixture(scope='module')
def installed(wheel, tmp_path_factory) -> Path:
    """Unpack the wheel, which is how pip installs a wheel without compiled files."""
    target = tmp_path_factory.mktemp('target')
    zipfile.ZipFile(wheel).extractall(target)
    return target


def run(installed: Path, *arguments: str) -> str:
    """Run Python outside the checkout, with the installed wheel before the other libraries on the path."""
    environment = {name: value for name, value in os.environ.items() if name != 'AMENT_PREFIX_PATH'}
    done = subprocess.run([sys.executable, *arguments], cwd=installed.parent, check=True, capture_output=True,
                          text=True, env={**environment, 'PYTHONPATH': str(installed)})
    return done.stdout


def test_the_wheel_contains_the_package_and_nothing_that_only_tests_or_training_need(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split('/')[0] for name in names}
    assert tops == {'tactile_node', f'tactile_skin-{tactile_node.__version__}.dist-info'}
    ours = {str(path.relative_to(ROOT)) for kind in ('*.py', '*.html') for path in (ROOT / 'tactile_node').rglob(kind)}
    data = {f'tactile_node/{path.relative_to(ROOT)}' for folder in ('config', 'msg', 'srv', 'action')
            for path in (ROOT / folder).iterdir()}
    assert {name for name in names if name.startswith('tactile_node/')} == ours | data | {'tactile_node/py.typed'}


def test_a_wheel_of_the_source_distribution_is_the_same(wheel, sdist, tmp_path):
    shutil.unpack_archive(sdist, tmp_path)
    again = wheel_of(next(tmp_path.glob('tactile_skin-*')), tmp_path)
    ours, theirs = ({entry.filename: entry.CRC for entry in zipfile.ZipFile(path).infolist()}
                    for path in (wheel, again))
    assert ours == theirs and wheel.name == again.name


def test_an_installed_wheel_knows_its_version(installed):
    out = run(installed, '-c', 'import tactile_node; print(tactile_node.__version__, tactile_node.__file__)')
    assert out.split() == [tactile_node.__version__, str(installed / 'tactile_node' / '__init__.py')]
    assert run(installed, '-m', 'tactile_node.cli.main', '--version').split()[-1] == tactile_node.__version__


def test_an_installed_wheel_finds_its_files(installed):
    names = ('config/recogniser.npz', 'config/sim16x16.yaml', 'msg/Grasp.msg', 'srv/CheckGrasp.srv',
             'action/WaitForGrasp.action')
    program = 'import sys; from tactile_node.package_files import package_file; print(*map(package_file, sys.argv[1:]))'
    assert run(installed, '-c', program, *names).split() == [str(installed / 'tactile_node' / name) for name in names]


def test_an_installed_wheel_recognises_a_contact(installed, tmp_path):
    frame = np.zeros((16, 16))
    frame[4:11, 5:12] = 1e5
    np.save(tmp_path / 'frame.npy', frame)
    line = json.loads(run(installed, '-m', 'tactile_node.cli.main', 'classify', str(tmp_path / 'frame.npy')))
    assert line['shape'] == 'square'
