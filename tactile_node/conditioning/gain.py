"""Define the gains of taxels and the curve from readings to pressures."""

from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.taxel_frame import read_only


def load_gains(path: str | Path, rows: int, cols: int) -> np.ndarray:
    """Return the gains from a file, float32 (rows, cols), read-only.

    The file is a .npy array, or a text file with one line per row of the pad and commas or blanks between the numbers.

    Parameters
    ----------
    path : str or Path
        The file.
    rows, cols : int
        Number of rows and columns of the pad.

    Raises
    ------
    ConfigurationError
        Raised if the file cannot be read, has a different shape, or contains an unusable gain.
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
    # damaged files raise errors of zipfile, tokenize and other modules that numpy does not catch
    except Exception as error:
        got = (str(error).splitlines() or [type(error).__name__])[0]
        raise ConfigurationError(where, expected='numbers, one line of text per row of the pad, or a .npy array',
                                 got=got, remedy='Correct the file, or create it again.') from error
    if gains.shape != (rows, cols):
        raise ConfigurationError(where, expected=f'{rows} rows of {cols} gains, one for each taxel of the pad',
                                 got=f'shape {gains.shape}', remedy='Give the gains of this pad.')
    low, high = 0.01, 100.0  # gains outside this range are typing errors or the gains of dead taxels
    wrong = ~((gains >= low) & (gains <= high))  # the condition is also true for NaN
    if wrong.any():
        row, col = np.argwhere(wrong)[0]
        raise ConfigurationError(where, expected=f'gains {low:g}..{high:g}',
                                 got=f'{gains[row, col]:g} at row {row}, column {col}',
                                 remedy='If a taxel has no gain, list it under dead_taxels in the layout, and give it '
                                 'the gain 1 in this file.')
    return read_only(gains)


class ResponseCurve(NamedTuple):
    """A piecewise linear curve through nodes that rise from (0, 0). For negative readings, the curve is mirrored.

    Beyond the last node, the last line is extended.
    """

    readings: np.ndarray   #: (k,), readings above a calibrated zero, rising from 0, in the unit of the taxels
    pressures: np.ndarray  #: (k,), pressures for these readings, rising from 0, in the unit of the taxels

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return the pressures for the given readings, with the same shape and type. NaN stays NaN.

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
    """Return the curve through the given nodes.

    Parameters
    ----------
    readings, pressures : list of float
        Coordinates of the nodes.

    Raises
    ------
    ConfigurationError
        Raised unless both lists rise from 0 and have the same length.
    """
    for name, nodes in (('readings', readings), ('pressures', pressures)):
        array = np.array(nodes, float)
        if len(array) < 2 or len(readings) != len(pressures) or array[0] != 0 or not (np.diff(array) > 0).all() \
                or not np.isfinite(array).all():
            raise ConfigurationError(f'{name} of a response curve', got=str(nodes)[:80],
                                     expected='two or more numbers that rise from 0, as many readings as pressures',
                                     remedy='Calibrate the skin again (tactile calibrate).')
    return ResponseCurve(read_only(np.array(readings, float)), read_only(np.array(pressures, float)))
