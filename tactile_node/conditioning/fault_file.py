"""Faulty taxels on file: kept from one run of the driver to the next, on request."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import yaml

from tactile_node.conditioning.taxel_faults import FaultyTaxels, TaxelFault
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.output_file import output_file
from tactile_node.read_only import read_only
from tactile_node.yaml_section import load_mapping

ABOUT = 'a file of faulty taxels'
HEAD = '''# Faulty taxels, [row, col], as the skin driver found them. They are NaN from the first frame on.
# Remove one to have it evaluated again; add one that you know to be faulty.
'''
KINDS = tuple(kind for kind in TaxelFault if kind)


def load_faults(path: str | Path, pads: Mapping[str, tuple[int, int]]) -> dict[str, FaultyTaxels]:
    """Read the faulty taxels of ``pads`` (name -> rows, cols). No file, or a pad not in it: none.

    Raises ConfigurationError naming file and key for anything else that is wrong.
    """
    kinds, path = {name: np.zeros(shape, np.uint8) for name, shape in pads.items()}, _usable(path)
    if path.exists():
        top = load_mapping(path, ABOUT)
        section = top.section('pads')
        for name, (rows, cols) in pads.items():
            given = section.section(name, {})
            for kind in KINDS:
                key = kind.name.lower()
                for taxel in given.sequence(key, []):
                    row, col = given.checked_integers(key, taxel, count=2, low=0, high=max(rows, cols) - 1)
                    if row >= rows or col >= cols:
                        given.refuse(key, expected=f'taxels of {rows} rows and {cols} columns', got=f'[{row}, {col}]',
                                     remedy='Correct or remove it.')
                    kinds[name][row, col] = kind
            given.done()
        top.done()
    return {name: FaultyTaxels(read_only(array)) for name, array in kinds.items()}


def save_faults(path: str | Path, faults: Mapping[str, FaultyTaxels]) -> None:
    """Write the faulty taxels of these pads; entries of other pads stay. Raises ConfigurationError."""
    path = _usable(path)
    pads = load_mapping(path, ABOUT).take('pads', {}) if path.exists() else {}
    if not isinstance(pads, dict):
        raise ConfigurationError(str(path), expected=ABOUT, got='another one', remedy='Name another file.')
    pads |= {name: {kind.name.lower(): [list(place) for place in found.places(kind)] for kind in KINDS}
             for name, found in faults.items()}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with output_file(path) as stream:
            stream.write((HEAD + yaml.safe_dump({'pads': pads}, default_flow_style=None, sort_keys=False)).encode())
    except (OSError, InputError) as error:
        got = error.got if isinstance(error, InputError) else error.strerror or str(error)
        raise ConfigurationError(str(path), expected='a file that can be written', got=got,
                                 remedy='Set faulty_taxels_file to another path.') from error


def _usable(path: str | Path) -> Path:
    """``~`` expanded. Raises ConfigurationError for a path that the system cannot even look for."""
    try:
        expanded = Path(path).expanduser()
        expanded.exists()
        return expanded
    except (OSError, RuntimeError, ValueError) as error:
        raise ConfigurationError(f'parameter faulty_taxels_file, {str(path)[:80]!r}', expected='a path',
                                 got=str(error)[:200], remedy='Set it to another path.') from error
