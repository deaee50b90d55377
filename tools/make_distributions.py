"""Build a source distribution from all files tracked by git, build a wheel from it, and test both.

Run `make dist`, or: python tools/make_distributions.py dist. To test a distribution, the script creates a new
environment, installs the distribution with its dependencies from the package index, and runs the commands that a new
user runs first. The script then prints the sizes of both distributions.
"""

import argparse
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOG = ROOT / 'test/data/sim16x16_two_pads.log.gz'
#: All archives contain this fixed date, so that builds from the same sources are identical.
EPOCH = '1735689600'  # 2025-01-01
OFFLINE = ('--quiet', '--disable-pip-version-check', '--no-index', '--no-build-isolation', '--no-deps')
SHAPES = {'circle', 'square', 'rectangle', 'right_triangle', 'isosceles_triangle'}


def tracked_sources(folder: Path) -> Path:
    """Copy the working versions of all files tracked by git to ``folder``, without build products."""
    names = subprocess.run(['git', 'ls-files', '-z'], cwd=ROOT, check=True, capture_output=True).stdout
    for name in filter(None, names.decode().split('\0')):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes((ROOT / name).read_bytes())
    return folder


def run(*command: object, cwd: Path, environment: Mapping[str, str] = os.environ) -> str:
    """Run ``command`` and return its output. Raises CalledProcessError if the command fails."""
    return subprocess.run([str(part) for part in command], cwd=cwd, env={**environment, 'SOURCE_DATE_EPOCH': EPOCH},
                          check=True, stdout=subprocess.PIPE, text=True).stdout


def source_distribution(source: Path, dist: Path) -> Path:
    """Build a source distribution of ``source`` with the PEP 517 hook of setuptools, and return its path."""
    hook = 'import sys; from setuptools import build_meta; print(build_meta.build_sdist(sys.argv[1]))'
    return dist / run(sys.executable, '-c', hook, dist, cwd=source).split()[-1]


def wheel(source: Path, dist: Path) -> Path:
    """Build a wheel from ``source``, a folder or a source distribution, and return the wheel's path."""
    before = set(dist.glob('*.whl'))
    run(sys.executable, '-m', 'pip', 'wheel', *OFFLINE, '--wheel-dir', dist, source, cwd=dist)
    made, = set(dist.glob('*.whl')) - before
    return made


def try_out(distribution: Path, work: Path) -> None:
    """Install ``distribution`` in a new environment, and run a new user's first commands.

    Raises CalledProcessError if a command fails.
    """
    run(sys.executable, '-m', 'venv', work / 'venv', cwd=work)
    binaries = work / 'venv/bin'
    clean = {name: value for name, value in os.environ.items() if name not in ('PYTHONPATH', 'AMENT_PREFIX_PATH')}
    run(binaries / 'python', '-m', 'pip', 'install', '--quiet', '--disable-pip-version-check', distribution, cwd=work)
    print(run(binaries / 'tactile', '--version', cwd=work, environment=clean).strip())
    run(binaries / 'tactile', 'replay', LOG, '--output', 'frames.npz', cwd=work, environment=clean)
    lines = run(binaries / 'tactile', 'classify', 'frames.npz', '--pitch', '0.004', cwd=work, environment=clean)
    shapes = {json.loads(line)['shape'] for line in lines.splitlines()}
    if not shapes >= SHAPES:
        raise SystemExit(f'{distribution.name}: expected the shapes {sorted(SHAPES)}, got {sorted(shapes)}')
    run(binaries / 'python', '-m', 'doctest', ROOT / 'README.md', cwd=work, environment=clean)
    run(binaries / 'python', '-c', 'from tactile_node.package_files import package_file as f; '
        'f("config/recogniser.npz"), f("config/sim16x16.eds"), f("msg/Grasp.msg"), f("py.typed")',
        cwd=work, environment=clean)


def main(arguments: list[str]) -> int:
    """Build and test the source distribution and the wheel in the given folder."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('dist', type=Path)
    dist = parser.parse_args(arguments).dist.resolve()
    dist.mkdir(parents=True, exist_ok=True)
    for old in (*dist.glob('*.whl'), *dist.glob('*.tar.gz')):
        old.unlink()
    with tempfile.TemporaryDirectory() as folder:
        made = [source_distribution(tracked_sources(Path(folder)), dist)]
    made.append(wheel(made[0], dist))
    for distribution in made:
        with tempfile.TemporaryDirectory() as folder:
            try_out(distribution, Path(folder))
        print(f'{distribution.name}: {distribution.stat().st_size / 1e6:.2f} MB, installed and tried')
    with tarfile.open(made[0]) as archive:
        print(f'{len(archive.getnames())} files in the source distribution')
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
