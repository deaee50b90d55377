"""Per-taxel gains: what makes the taxels of a pad equally sensitive."""

from io import BytesIO
from pathlib import Path

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.read_only import read_only

BYTES, HEAD = 64, 4096  #: that a file may have for each gain, and beside them
WITHIN = (0.01, 100.0)  #: a gain beyond is a typing error or a dead taxel


def load_gains(path: str | Path, rows: int, cols: int) -> np.ndarray:
    """Read gains, float32 (rows, cols), read-only, from .npy or from text: a row of the pad a line, commas or blanks.

    Raises ConfigurationError for a file that cannot be read, another shape, or a gain that is none.
    """
    where = f'gain file {path}'
    try:
        is_binary = str(path).endswith('.npy')
        written = _read(Path(path), BYTES * rows * cols + HEAD)
        gains = np.load(BytesIO(written), allow_pickle=False) if is_binary else _text(written)
        if gains.dtype.kind not in 'iuf':
            raise ValueError(f'an array of {gains.dtype}')
        gains = gains.astype(np.float32)
    except Exception as error:  # numpy lets through what zipfile, tokenize and others raise over broken files
        got = (str(error).splitlines() or [type(error).__name__])[0]
        raise ConfigurationError(where, expected='numbers, a row of the pad a line (text), or a .npy array', got=got,
                                 remedy='Correct the file, or make it again.') from error
    if gains.shape != (rows, cols):
        raise ConfigurationError(where, expected=f'{rows} rows of {cols} gains, as the pad has taxels',
                                 got=f'shape {gains.shape}', remedy='Give the gains of this pad.')
    low, high = WITHIN
    wrong = ~((gains >= low) & (gains <= high))  # NaN too
    if wrong.any():
        row, col = np.argwhere(wrong)[0]
        raise ConfigurationError(where, expected=f'gains {low:g}..{high:g}',
                                 got=f'{gains[row, col]:g} at row {row}, column {col}',
                                 remedy='Name a taxel without a gain in dead_taxels of the layout, with gain 1 here.')
    return read_only(gains)


def _read(path: Path, most: int) -> bytes:
    with path.open('rb') as stream:
        written = stream.read(most + 1)
    if len(written) > most:
        raise ValueError(f'more than {most} bytes, too much for this pad')
    return written


def _text(written: bytes) -> np.ndarray:
    return np.loadtxt(written.decode('utf-8').replace(',', ' ').splitlines(), ndmin=2)
