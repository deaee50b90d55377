"""Keep the faulty taxels of pads in a file."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import yaml

from tactile_node.conditioning.taxel_faults import FaultyTaxels, TaxelFault
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.output_file import output_file
from tactile_node.taxel_frame import read_only
from tactile_node.yaml_keys import ListOf, Wholes
from tactile_node.yaml_section import load_mapping

FILE_CONTENT = 'a file of faulty taxels'
FILE_HEAD = '''# Faulty taxels, [row, col], as the skin driver found them. They are NaN from the first frame on.
# Remove a taxel to have it evaluated again. Add a taxel that you know to be faulty.
'''
FAULT_KINDS = tuple(kind for kind in TaxelFault if kind)


def load_faults(path: str | Path, pads: Mapping[str, tuple[int, int]]) -> dict[str, FaultyTaxels]:
    """Return the faulty taxels of some pads from a file. A pad that the file does not list has no faulty taxels.

    Parameters
    ----------
    path : str or Path
        The file.
    pads : mapping of str to tuple of int
        Number of rows and columns of each pad, by pad name.

    Raises
    ------
    ConfigurationError
        Raised if the file cannot be used. The error names the file and the key.
    """
    kinds, path = {name: np.zeros(shape, np.uint8) for name, shape in pads.items()}, _usable(path)
    if path.exists():
        top = load_mapping(path, FILE_CONTENT)
        section = top.section('pads')
        for name, (rows, cols) in pads.items():
            given = section.section(name, {})
            for kind in FAULT_KINDS:
                key = kind.name.lower()
                for row, col in given.read(key, ListOf(Wholes(2, 0, max(rows, cols) - 1)), ()):
                    if row >= rows or col >= cols:
                        given.refuse(key, expected=f'taxels of {rows} rows and {cols} columns', got=f'[{row}, {col}]',
                                     remedy='Correct or remove it.')
                    kinds[name][row, col] = kind
            given.done()
        top.done()
    return {name: FaultyTaxels(read_only(array)) for name, array in kinds.items()}


def save_faults(path: str | Path, faults: Mapping[str, FaultyTaxels]) -> None:
    """Write the faulty taxels of these pads to a file. The entries of other pads are kept.

    Raises
    ------
    ConfigurationError
        Raised if the file cannot be written or has another kind of content.
    """
    path = _usable(path)
    pads = load_mapping(path, FILE_CONTENT).take('pads', {}) if path.exists() else {}
    if not isinstance(pads, dict):
        raise ConfigurationError(str(path), expected=FILE_CONTENT, got='another kind of file',
                                 remedy='Name another file.')
    pads |= {name: {kind.name.lower(): [list(place) for place in found.places(kind)] for kind in FAULT_KINDS}
             for name, found in faults.items()}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with output_file(path) as stream:
            content = yaml.safe_dump({'pads': pads}, default_flow_style=None, sort_keys=False)
            stream.write((FILE_HEAD + content).encode())
    except (OSError, InputError) as error:
        got = error.got if isinstance(error, InputError) else error.strerror or str(error)
        raise ConfigurationError(str(path), expected='a file that can be written', got=got,
                                 remedy='Set faulty_taxels_file to another path.') from error


def _usable(path: str | Path) -> Path:
    """Return the path with ``~`` expanded. The function raises ConfigurationError if the system cannot look up this
    path."""
    try:
        expanded = Path(path).expanduser()
        expanded.exists()
        return expanded
    except (OSError, RuntimeError, ValueError) as error:
        raise ConfigurationError(f'parameter faulty_taxels_file, {str(path)[:80]!r}', expected='a path',
                                 got=str(error)[:200], remedy='Set it to another path.') from error
