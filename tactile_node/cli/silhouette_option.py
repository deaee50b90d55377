"""What a simulated skin may be touched by: one of the five shapes, a named figure, or a picture of another one."""

from pathlib import Path

import numpy as np

from tactile_node.errors import InputError
from tactile_node.synthetic.figures import MOST_SIDE, NAMED, Silhouette, named_silhouette, silhouette_of
from tactile_node.synthetic.world import CLASSES

DARK = 128  #: grey values below belong to the figure


def touching(text: str) -> str | Silhouette:
    """Return the class of that name, or the silhouette of a name or of a picture. Raises InputError for another."""
    if text in CLASSES:
        return text
    if text in NAMED:
        return named_silhouette(text)
    path = Path(text)
    if not path.is_file():
        raise InputError('--shapes', expected=f'{", ".join((*CLASSES, *NAMED))}, or a picture', got=repr(text),
                         remedy='Name one of them, or the file of a picture, dark on white, or of a bool .npy array.')
    return silhouette_of(path.stem, _array(path) if path.suffix == '.npy' else _picture(path))


def _array(path: Path) -> np.ndarray:
    try:
        array = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise _unusable(path, ' '.join(str(error).split())) from None
    if not isinstance(array, np.ndarray) or array.dtype.kind not in 'biu':
        raise _unusable(path, 'another kind of array')
    return array != 0


def _picture(path: Path) -> np.ndarray:
    from PIL import Image, UnidentifiedImageError  # optional

    try:
        with Image.open(path) as picture:
            if max(picture.size) > MOST_SIDE:
                raise _unusable(path, f'{picture.width} x {picture.height}')
            return np.asarray(picture.convert('L')) < DARK
    except (OSError, UnidentifiedImageError, ValueError, SyntaxError) as error:
        raise _unusable(path, ' '.join(str(error).split())) from None


def _unusable(path: Path, got: str) -> InputError:
    return InputError(f'picture {str(path)!r}', expected=f'dark on white, up to {MOST_SIDE} x {MOST_SIDE}, or a bool '
                      '.npy array', got=got, remedy='Write it as .png.')
