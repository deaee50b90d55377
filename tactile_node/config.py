"""Finds the files of ``config/`` wherever this package is installed."""

import os
import sys
from pathlib import Path

from tactile_node.errors import ConfigurationError

PACKAGE = 'tactile_skin'


def config_path(name: str) -> Path:
    """Return the path of ``name``: as given when such a file exists, else from our ``config/``.

    Looked for in the checkout, in every prefix of AMENT_PREFIX_PATH (a ROS workspace) and in the
    Python environment. Raises ConfigurationError where it is in none of them.
    """
    given = Path(name).expanduser()
    candidates = [given] + [folder / name for folder in _config_folders()]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    raise ConfigurationError(
        f'file {name!r}', expected='an existing file, or the name of one in config/',
        got='no such file', remedy=f'Looked in {", ".join(str(c.parent) for c in candidates)}.')


def _config_folders() -> list[Path]:
    prefixes = [p for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
    shares = [Path(prefix) / 'share' / PACKAGE for prefix in [*prefixes, sys.prefix]]
    checkout = Path(__file__).resolve().parents[1]
    return [root / 'config' for root in [checkout, *shares]]
