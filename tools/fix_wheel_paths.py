"""Make the CMake files in the ROS wheels use the headers of this environment.

The build with `make` runs this script once.

The CMake targets exported by the wheels refer to the Python and NumPy headers on the machine that built the wheels.
Without this script, CMake stops with "includes non-existent path".
"""

import re
import sys
import sysconfig
from pathlib import Path

import numpy

BUILDER_NUMPY = re.compile(r'/opt/python/cp\d+-cp\d+/lib/python3\.\d+/site-packages/numpy/_core/include')
BUILDER_PYTHON = re.compile(r'/opt/python/cp\d+-cp\d+/include/python3\.\d+')


def rewritten(text: str) -> str:
    """Return ``text`` with the header folders of the build machine replaced by the folders of this environment."""
    text = BUILDER_NUMPY.sub(lambda _: numpy.get_include(), text)
    return BUILDER_PYTHON.sub(lambda _: sysconfig.get_paths()['include'], text)


def main() -> int:
    header = Path(sysconfig.get_paths()['include']) / 'Python.h'
    if not header.is_file():
        print(f'setup: expected the Python headers, got no {header}. Install them (Debian, Ubuntu: '
              'apt install python3-dev) and run make again.', file=sys.stderr)
        return 2
    for file in (Path(sys.prefix) / 'share').glob('*/cmake/*.cmake'):
        text = file.read_text()
        if '/opt/python/' in text:
            file.write_text(rewritten(text))
    return 0


if __name__ == '__main__':
    sys.exit(main())
