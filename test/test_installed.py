"""A wheel, installed where no checkout is in reach: it has its files, its version, its types and no more."""

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


@pytest.fixture(scope='module')
def wheel(tmp_path_factory) -> Path:
    """A wheel, built of a copy: setuptools leaves a build folder where it builds. There is one of an earlier build."""
    source = tmp_path_factory.mktemp('source')
    for folder in ('tactile_node', 'config', 'msg'):
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns('__pycache__'))
    for name in ('setup.py', 'setup.cfg', 'pyproject.toml', 'MANIFEST.in', 'package.xml', 'README.md'):
        shutil.copy(ROOT / name, source)
    stale = source / 'build/lib/tactile_node/renamed_since.py'
    stale.parent.mkdir(parents=True)
    stale.touch()
    built = tmp_path_factory.mktemp('built')
    subprocess.run([sys.executable, '-m', 'pip', 'wheel', '--quiet', '--no-index', '--no-build-isolation', '--no-deps',
                    '--wheel-dir', built, source], check=True)
    return next(built.glob('*.whl'))


@pytest.fixture(scope='module')
def installed(wheel, tmp_path_factory) -> Path:
    target = tmp_path_factory.mktemp('target')
    subprocess.run([sys.executable, '-m', 'pip', 'install', '--quiet', '--no-index', '--no-deps', '--target', target,
                    wheel], check=True)
    return target


def run(installed: Path, *arguments: str) -> str:
    """Run Python outside the checkout, where only the installed wheel comes before the environment's libraries."""
    environment = {name: value for name, value in os.environ.items() if name != 'AMENT_PREFIX_PATH'}
    done = subprocess.run([sys.executable, *arguments], cwd=installed.parent, check=True, capture_output=True,
                          text=True, env={**environment, 'PYTHONPATH': str(installed)})
    return done.stdout


def test_it_holds_what_runs_and_nothing_that_only_tests_or_training_need(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split('/')[0] for name in names}
    assert tops == {'tactile_node', f'tactile_skin-{tactile_node.__version__}.dist-info'}
    ours = {str(path.relative_to(ROOT)) for path in (ROOT / 'tactile_node').rglob('*.py')}
    data = {f'tactile_node/{path.relative_to(ROOT)}' for folder in ('config', 'msg')
            for path in (ROOT / folder).iterdir()}
    assert {name for name in names if name.startswith('tactile_node/')} == ours | data | {'tactile_node/py.typed'}


def test_it_knows_its_version(installed):
    out = run(installed, '-c', 'import tactile_node; print(tactile_node.__version__, tactile_node.__file__)')
    assert out.split() == [tactile_node.__version__, str(installed / 'tactile_node' / '__init__.py')]
    assert run(installed, '-m', 'tactile_node.cli.main', '--version').split()[-1] == tactile_node.__version__


def test_its_examples_are_true(installed):
    program = 'import doctest, tactile_node; print(*doctest.testmod(tactile_node))'
    failed, attempted = run(installed, '-c', program).split()
    assert int(attempted) and not int(failed)


@pytest.mark.parametrize('name', ['config/recogniser.npz', 'config/sim16x16.yaml', 'msg/Grasp.msg'])
def test_it_finds_its_files(installed, name):
    program = f'from tactile_node.package_files import package_file; print(package_file({name!r}))'
    assert run(installed, '-c', program).strip() == str(installed / 'tactile_node' / name)


def test_it_recognises(installed, tmp_path):
    frame = np.zeros((16, 16))
    frame[4:11, 5:12] = 1e5
    np.save(tmp_path / 'frame.npy', frame)
    line = json.loads(run(installed, '-m', 'tactile_node.cli.main', 'classify', str(tmp_path / 'frame.npy')))
    assert line['shape'] == 'square'
