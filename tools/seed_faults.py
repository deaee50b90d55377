"""Show that the tests find faults, by putting one fault at a time into a copy of the package and running the tests.

    python tools/seed_faults.py [--all-tests] [NAME ...]

The file seeded_faults.yaml lists the faults. Each fault names a source file, a text in this file, the replacement of
the text, and the test files that should notice the fault. With ``--all-tests``, the script runs all tests instead. The
exit code is 1 if the tests miss a fault.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import yaml

ROOT = Path(__file__).resolve().parents[1]
FAULTS = Path(__file__).with_name('seeded_faults.yaml')


class SeededFault(NamedTuple):
    """A fault that replaces the text ``old`` in ``file`` with ``new``, so that at least one of ``tests`` must fail."""

    name: str
    file: str
    old: str
    new: str
    tests: list[str]


def load_faults(path: Path = FAULTS) -> list[SeededFault]:
    """Return all faults listed in the file."""
    return [SeededFault(**each) for each in yaml.safe_load(path.read_text())]


def finding_test(fault: SeededFault, tests: list[str]) -> str | None:
    """Seed ``fault``, run the test files ``tests``, and return the first failing test, or None if all tests pass.

    The function raises ValueError if the text to replace does not occur exactly once.
    """
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / 'copy'
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns('.git', '.venv*', 'build', '__pycache__', 'dist'))
        seeded = copy / fault.file
        text = seeded.read_text()
        if text.count(fault.old) != 1:
            raise ValueError(f'{fault.name}: the text to replace occurs {text.count(fault.old)} times in {fault.file}')
        seeded.write_text(text.replace(fault.old, fault.new))
        command = [sys.executable, '-m', 'pytest', '-x', '-q', '-p', 'no:cacheprovider', '--tb=no', '-rfE',
                   *(f'test/{name}' for name in tests)]
        ran = subprocess.run(command, cwd=copy, env=os.environ | {'PYTHONPATH': str(copy)}, text=True,
                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    failed = [line for line in ran.stdout.splitlines() if line.startswith(('FAILED', 'ERROR'))]
    if ran.returncode not in (0, 1, 2):
        raise RuntimeError(ran.stdout)
    return failed[0].split(' - ')[0] if failed else None


def main() -> int:
    """Seed each fault, and print which test finds it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('names', nargs='*', help='names of the faults to seed, default all')
    parser.add_argument('--all-tests', action='store_true', help='run all tests instead of the expected ones')
    given = parser.parse_args()
    chosen = [fault for fault in load_faults() if not given.names or fault.name in given.names]
    missed = 0
    for fault in chosen:
        found = finding_test(fault, [''] if given.all_tests else fault.tests)
        missed += found is None
        print(f'{fault.name:45} {found or "*** NOT FOUND ***"}', flush=True)
    print(f'{len(chosen) - missed} of {len(chosen)} seeded faults found')
    return int(missed > 0)


if __name__ == '__main__':
    sys.exit(main())
