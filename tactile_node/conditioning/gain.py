"""What a reading means: gains of taxels, and the curve from readings to pressures."""

from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.taxel_frame import read_only


def load_gains(path: str | Path, rows: int, cols: int) -> np.ndarray:
    """Read gains, float32 (rows, cols), read-only, from .npy or from text: a row of the pad a line, commas or blanks.

    Raises ConfigurationError for a file that cannot be read, another shape, or a gain that is none.
    """
    where, most = f'gain file {path}', 64 * rows * cols + 4096
    try:
        is_binary = str(path).endswith('.npy')
        with Path(path).open('rb') as stream:
            written = stream.read(most + 1)
        if len(written) > most:
            raise ValueError(f'more than {most} bytes, too much for this pad')
        gains = np.load(BytesIO(written), allow_pickle=False) if is_binary else np.loadtxt(
            written.decode('utf-8').replace(',', ' ').splitlines(), ndmin=2)
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
    low, high = 0.01, 100.0  # beyond is a typing error or a dead taxel
    wrong = ~((gains >= low) & (gains <= high))  # NaN too
    if wrong.any():
        row, col = np.argwhere(wrong)[0]
        raise ConfigurationError(where, expected=f'gains {low:g}..{high:g}',
                                 got=f'{gains[row, col]:g} at row {row}, column {col}',
                                 remedy='Name a taxel without a gain in dead_taxels of the layout, with gain 1 here.')
    return read_only(gains)


class ResponseCurve(NamedTuple):
    """Straight lines between nodes, from (0, 0) upwards; the same for negative readings, mirrored.

    Beyond the last node the last line goes on.
    """

    readings: np.ndarray   #: (k,), of a calibrated zero, rising from 0 [unit of the taxels]
    pressures: np.ndarray  #: (k,), rising from 0 [the same unit]

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return the pressures of ``values``, same shape and type; NaN stays NaN.

        >>> curve = ResponseCurve(np.array((0.0, 1.0, 2.0)), np.array((0.0, 1.0, 4.0)))
        >>> curve(np.array((-1.0, 0.5, 3.0, np.nan))).tolist()
        [-1.0, 0.5, 7.0, nan]
        """
        size = np.abs(values)
        last = (self.pressures[-1] - self.pressures[-2]) / (self.readings[-1] - self.readings[-2])
        beyond = np.maximum(size - self.readings[-1], 0.0) * last
        found: np.ndarray = np.copysign(np.interp(size, self.readings, self.pressures) + beyond, values)
        return found.astype(values.dtype, copy=False)


def make_curve(readings: list[float], pressures: list[float]) -> ResponseCurve:
    """Make a curve of nodes. Raises ConfigurationError unless both rise from 0."""
    for name, nodes in (('readings', readings), ('pressures', pressures)):
        array = np.array(nodes, float)
        if len(array) < 2 or len(readings) != len(pressures) or array[0] != 0 or not (np.diff(array) > 0).all() \
                or not np.isfinite(array).all():
            raise ConfigurationError(f'{name} of a response curve', got=str(nodes)[:80],
                                     expected='two or more numbers that rise from 0, as many readings as pressures',
                                     remedy='Calibrate the skin again (tactile calibrate).')
    return ResponseCurve(read_only(np.array(readings, float)), read_only(np.array(pressures, float)))
