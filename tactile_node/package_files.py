"""Finds the files that come with this package, wherever it is installed."""

import os
import sys
from pathlib import Path

from tactile_node.errors import ConfigurationError

PACKAGE = 'tactile_skin'


def config_path(name: str) -> Path:
    """Return the path of ``name``: as given when such a file exists, else from our ``config/``.

    Raises ConfigurationError where it is in neither.
    """
    given = Path(name).expanduser()
    return given if given.is_file() else package_file(f'config/{name}')


def package_file(name: str) -> Path:
    """Return the path of a file of this package, such as 'config/sim16x16.yaml'.

    Looked for in the checkout, in every prefix of AMENT_PREFIX_PATH (a ROS workspace) and in the
    Python environment. Raises ConfigurationError where it is in none of them.
    """
    for root in _roots():
        if (root / name).is_file():
            return root / name
    raise ConfigurationError(
        f'file {name.removeprefix("config/")!r}', expected='an existing file, or the name of one in config/',
        got='no such file', remedy=f'Looked in the current folder and in {", ".join(str(root) for root in _roots())}.')


def _roots() -> list[Path]:
    prefixes = [p for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
    shares = [Path(prefix) / 'share' / PACKAGE for prefix in [*prefixes, sys.prefix]]
    checkout = Path(__file__).resolve().parents[1]
    return [checkout, *shares]
