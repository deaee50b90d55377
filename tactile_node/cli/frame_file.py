"""Read and write files with the taxel frames of one pad: .npy, .npz (as `tactile replay` writes it), .csv and .png."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np

from tactile_node.cli.frame_png import DEFAULT_GREYS, Greys, read_png
from tactile_node.errors import InputError
from tactile_node.logs.bag_records import is_bag
from tactile_node.taxel_frame import PRESS_BY_UNIT, TaxelFrame, TaxelStatus

SEPARATORS = ',', ';', '\t'
TEXT_REMEDY = ('Write numbers with a decimal point, a line for each row of taxels, and an empty line between frames. '
               'docs/howto/without_ros.md shows how to convert an export with a header, with two lines of NumPy.')


def read_text(content: bytes, where: str) -> np.ndarray:
    r"""Return the taxel frames in a text file, with NaN for each cell that is empty or not finite.

    The first row determines the separator of all cells: a comma, a semicolon or a tab, checked in this order, or else
    blanks. Lines that start with # are ignored.

    Parameters
    ----------
    content
        Content of the file, UTF-8.
    where
        File name to show in error messages.

    Returns
    -------
    numpy.ndarray
        Frames, shape (K, rows, cols), float.

    Raises
    ------
    InputError
        Raised if the text does not contain frames of one size. The error message names the line and the cell.

    Examples
    --------
    >>> read_text(b'1,2\n,4\n\n5,6\n7,8\n', 'a file').tolist()
    [[[1.0, 2.0], [nan, 4.0]], [[5.0, 6.0], [7.0, 8.0]]]
    """
    try:
        lines = [(number, line) for number, line in enumerate(content.decode('utf-8-sig').splitlines(), 1)
                 if not line.startswith('#')]
    except UnicodeDecodeError:
        raise _bad(where, 'text', 'bytes that are not text') from None
    first = next((line for _, line in lines if line.strip(' ')), None)
    if first is None:
        raise _bad(where, 'a row of taxels', 'no line with numbers')
    separator = next((each for each in SEPARATORS if each in first), None)
    width = len(first.split(separator))
    frames: list[list[list[float]]] = [[]]
    for number, line in lines:
        if line.strip(' '):
            frames[-1].append(_row(line.split(separator), width, f'{where}, line {number}'))
        else:
            frames.append([])
    given = [frame for frame in frames if frame]
    if len({len(frame) for frame in given}) > 1:
        raise _bad(where, f'{len(given[0])} rows in each frame, as in the first',
                   ', '.join(str(len(frame)) for frame in given[:8]))
    found = np.array(given)
    found[~np.isfinite(found)] = np.nan
    return found


def _row(cells: list[str], width: int, where: str) -> list[float]:
    if len(cells) != width:
        raise _bad(where, f'{width} cells, as in the first row', str(len(cells)))
    return [_value(cell, f'{where}, cell {place}') for place, cell in enumerate(cells, 1)]


def _value(cell: str, where: str) -> float:
    try:
        return float(cell) if cell.strip() else float('nan')
    except ValueError:
        raise _bad(where, 'a number, or nothing', repr(cell[:40])) from None


def _bad(where: str, expected: str, got: str) -> InputError:
    return InputError(where, expected=expected, got=got, remedy=TEXT_REMEDY)


FORMATS = {'.npy': 'npy', '.npz': 'npz', '.csv': 'csv', '.png': 'png'}
#: file formats by first bytes; a file with other first bytes is text
FORMAT_MAGIC = {b'\x93NUMPY': 'npy', b'PK': 'npz', b'\x89PNG': 'png'}
#: name of the array in an .npz that contains the frames
VALUES_NAME = 'values'
#: maximum size of an archive after unpacking [bytes], because a small file can claim any size; 2 GiB hold 9 hours of 16
#: x 16 taxels at 50 Hz
MOST_UNPACKED = 2 << 30
VALUED_STATUSES = TaxelStatus.VALID, TaxelStatus.SATURATED
FILE_REMEDY = 'Give a .npy, .npz, .csv or .png file; `tactile classify --help` describes each format.'


class TaxelFrames(NamedTuple):
    """Successive frames of one pad. An attribute that the file does not contain is None."""

    values: np.ndarray  #: taxel values (K, rows, cols), bool or float, NaN where there is no valid value
    stamps: np.ndarray | None = None    #: acquisition time of each frame (K,) [s, Unix epoch]
    sequence: np.ndarray | None = None  #: sequence number of each frame (K,), as in TaxelFrame
    status: np.ndarray | None = None    #: `TaxelStatus` of each taxel (K, rows, cols)
    pad: str | None = None
    pitch: float | None = None          #: [m]
    unit: str | None = None             #: unit of the values: 'Pa', 'N' or '1' (on/off)

    @classmethod
    def of(cls, frames: Sequence[TaxelFrame], shape: tuple[int, int], pad: str, pitch: float, unit: str
           ) -> 'TaxelFrames':
        """Return the ``frames`` of a pad with ``shape`` (rows, cols)."""
        return cls(np.array([frame.values for frame in frames], np.float32).reshape(-1, *shape),
                   np.array([frame.stamp for frame in frames], float),
                   np.array([frame.sequence for frame in frames], np.int64),
                   np.array([frame.status for frame in frames], np.uint8).reshape(-1, *shape), pad, pitch, unit)

    def known_of(self, k: int) -> dict:
        """Return the pad, stamp and sequence number of frame ``k`` by name, as far as the file contains them."""
        known: dict = {} if self.pad is None else {'pad': self.pad}
        if self.stamps is not None:
            known['stamp'] = float(self.stamps[k])
        if self.sequence is not None:
            known['sequence'] = int(self.sequence[k])
        return known


def read_frames(path: str, greys: Greys = DEFAULT_GREYS) -> TaxelFrames:
    """Read the taxel frames in a file. The suffix determines the format. If the suffix is unknown, the first bytes
    determine the format.

    Parameters
    ----------
    path
        Path of the file.
    greys
        Taxel values of black and white pixels in a picture.

    Raises
    ------
    InputError
        Raised if the file cannot be read or contains no taxel frames.
    """
    if is_bag(path):
        raise InputError(f'file {path!r}', expected='taxel frames in an .npy, .npz, .csv or .png file',
                         got='a ROS 2 bag', remedy='Convert it with `tactile replay BAG --output frames.npz`.')
    content = _content(path)
    if not content:
        raise _unusable(path, 'nothing')
    found = next((kind for magic, kind in FORMAT_MAGIC.items() if content.startswith(magic)), 'csv')
    kind = FORMATS.get(Path(path).suffix.lower(), found)
    if kind == 'csv':
        return TaxelFrames(read_text(content, f'file {path!r}'))
    if kind == 'png':
        return TaxelFrames(read_png(content, f'file {path!r}', greys)[np.newaxis])
    if kind != found:
        raise _unusable(path, 'content in another format')
    if kind == 'npy':
        return TaxelFrames(_frames(path, _load(path, content)))
    return _of_archive(path, _load_archive(path, content))


def write_archive(stream: BinaryIO, frames: TaxelFrames) -> None:
    """Write taxel frames with all attributes as an .npz archive, which `read_frames` can read."""
    np.savez_compressed(stream, **frames._asdict())


def _content(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise _unusable(path, error.strerror or str(error)) from None
    except MemoryError:
        raise _unusable(path, 'more than fits into memory') from None


def _load_archive(path: str, content: bytes) -> dict[str, np.ndarray]:
    try:
        with ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
    except Exception as error:  # zipfile also raises errors from struct, and for versions that it does not know
        raise _unusable(path, str(error)) from None
    # Python stops unpacking at the announced size, except for the compressions that NumPy does not write.
    if other := [member.filename for member in members if member.compress_type not in (ZIP_STORED, ZIP_DEFLATED)]:
        raise _unusable(path, f'the member {other[0]!r} in a compression that NumPy does not write')
    if (size := sum(member.file_size for member in members)) > MOST_UNPACKED:
        raise _unusable(path, f'{size / (1 << 30):.1f} GiB unpacked, more than {MOST_UNPACKED >> 30}')
    arrays = _load(path, content)
    if strange := [name for name, each in arrays.items() if not isinstance(each, np.ndarray)]:
        raise _unusable(path, f'the member {strange[0]!r}, which holds no array')
    return arrays


def _load(path: str, content: bytes) -> Any:
    """Return the array in an .npy file, or the members of an .npz archive by name."""
    try:
        loaded = np.load(io.BytesIO(content), allow_pickle=False)
        return loaded if isinstance(loaded, np.ndarray) else dict(loaded)
    except MemoryError:
        raise _unusable(path, 'more than fits into memory') from None
    except Exception as error:  # NumPy also raises errors from zipfile, zlib and tokenize
        raise _unusable(path, ' '.join(str(error).split()) or type(error).__name__) from None


def _of_archive(path: str, arrays: dict[str, np.ndarray]) -> TaxelFrames:
    if VALUES_NAME not in arrays and len(arrays) != 1:
        raise _unusable(path, f'an archive of {", ".join(map(repr, sorted(arrays))) or "no array"}, none of them '
                        f'{VALUES_NAME!r}')
    values = _frames(path, arrays.get(VALUES_NAME, next(iter(arrays.values()))))
    if VALUES_NAME not in arrays:
        return TaxelFrames(values)
    unit, pitch, pad = (_single(path, arrays, name) for name in ('unit', 'pitch', 'pad'))
    if unit is not None and unit not in PRESS_BY_UNIT:
        raise _unusable(path, f'the unit {unit!r}, which is not one of {", ".join(PRESS_BY_UNIT)}')
    if pitch is not None and not (isinstance(pitch, float) and 0 < pitch < np.inf):
        raise _unusable(path, f'the pitch {pitch!r}, which is not a length in metres')
    if pad is not None and not isinstance(pad, str):
        raise _unusable(path, f'the pad {pad!r}, which is not a name')
    status = _each(path, arrays, 'status', values.shape, 'iu')
    if status is not None:
        _check_status(path, values, status)
    return TaxelFrames(
        values, _each(path, arrays, 'stamps', values.shape[:1], 'f'),
        _each(path, arrays, 'sequence', values.shape[:1], 'iu'), status, pad, pitch, unit)


def _single(path: str, arrays: dict[str, np.ndarray], name: str) -> Any:
    if name not in arrays:
        return None
    if arrays[name].size != 1:
        raise _unusable(path, f'{name} of shape {arrays[name].shape} instead of one value for all frames')
    return arrays[name].item()


def _check_status(path: str, values: np.ndarray, status: np.ndarray) -> None:
    """Raise InputError for an unknown status number, or for a value on a taxel whose status means "no value"."""
    if not np.isin(status, list(TaxelStatus)).all():
        raise _unusable(path, f'a status outside the range {min(TaxelStatus)} to {max(TaxelStatus)}')
    if (np.isfinite(values) & ~np.isin(status, VALUED_STATUSES)).any():
        raise _unusable(path, 'values of taxels whose status says that they have none')


def _each(path: str, arrays: dict[str, np.ndarray], name: str, shape: tuple[int, ...], kinds: str) -> np.ndarray | None:
    found = arrays.get(name)
    if found is not None and (found.shape != shape or found.dtype.kind not in kinds or not np.isfinite(found).all()):
        raise _unusable(path, f'{name} of shape {found.shape} and type {found.dtype}, or not finite, for frames of '
                        f'shape {shape}')
    return found


def _frames(path: str, array: np.ndarray) -> np.ndarray:
    """Return the frames in shape (K, rows, cols), bool or float, with NaN for values that are not finite."""

    if array.dtype.kind not in 'biuf':
        raise _unusable(path, f'numbers of type {array.dtype}')
    frames = array[np.newaxis] if array.ndim == 2 else array
    if frames.ndim != 3 or 0 in frames.shape[1:]:
        raise _unusable(path, f'shape {array.shape}')
    if frames.dtype == bool:
        return frames
    frames = frames.astype(float)
    frames[~np.isfinite(frames)] = np.nan
    return frames


def _unusable(path: str, got: str) -> InputError:
    return InputError(f'file {path!r}', expected='taxel frames (K, rows, cols) or (rows, cols), bool, integer or float',
                      got=got, remedy=FILE_REMEDY)
