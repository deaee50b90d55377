"""Read a taxel frame from a grey picture with one pixel per taxel. The top line of pixels is taxel row 0."""

import io
from typing import NamedTuple

import numpy as np

from tactile_node.errors import InputError
from tactile_node.skin.layout import MAX_SIDE

PICTURE_REMEDY = (f'Save a grey picture with one pixel per taxel, at most {MAX_SIDE} x {MAX_SIDE}. Make a pixel '
                  'transparent if its taxel has no valid value.')


class Greys(NamedTuple):
    """Taxel values of black and white pixels. Values of other greys are interpolated linearly."""

    black: float
    white: float


DEPTH_OFFSET = 24  #: offset of the bit depth [bytes] (PNG specification 11.2.2: the IHDR chunk comes first)
DEFAULT_GREYS = Greys(0.0, 1.0)  #: values are fractions of full scale, and bright means pressed


def read_png(content: bytes, where: str, greys: Greys = DEFAULT_GREYS) -> np.ndarray:
    """Return the taxel frame in a PNG file.

    Parameters
    ----------
    content
        Bytes of the file.
    where
        Name of the file for error messages.
    greys
        Taxel values of black and white pixels.

    Returns
    -------
    numpy.ndarray
        Taxel values, shape (rows, cols), NaN where a pixel is transparent.

    Raises
    ------
    InputError
        Raised if the picture is in colour, has half-transparent pixels, is larger than a pad or cannot be read.
    """
    from PIL import Image, UnidentifiedImageError  # Pillow is optional (extra `picture`) and slow to import

    try:
        with Image.open(io.BytesIO(content), formats=['PNG']) as picture:
            if max(picture.size) > MAX_SIDE or getattr(picture, 'n_frames', 1) > 1:
                raise _bad(where, f'{picture.width} x {picture.height} pixels, {getattr(picture, "n_frames", 1)} '
                           'pictures')
            is_deep = picture.mode.startswith('I')
            # grey value of transparent pixels, or None
            clear = picture.info.get('transparency')
            # Pillow would compare the unscaled grey value
            if clear is not None and picture.mode == 'L' and content[DEPTH_OFFSET] < 8:
                raise _bad(where, f'a transparent grey of {content[DEPTH_OFFSET]} bits')
            pixels = np.asarray(picture if is_deep else picture.convert('RGBA'))
    except InputError:
        raise
    except UnidentifiedImageError:
        raise _bad(where, 'a file that is not a readable PNG') from None
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise _bad(where, ' '.join(str(error).split())[:80]) from None
    if is_deep:  # 16 bits
        return np.where(pixels == clear, np.nan, _scale(pixels / 65535, greys))
    if (pixels[..., :3] != pixels[..., :1]).any():
        raise _bad(where, 'colours, which cannot be ordered by pressure')
    opaque = pixels[..., 3] == 255
    if not (opaque | (pixels[..., 3] == 0)).all():
        raise _bad(where, 'pixels that are half transparent')
    return np.where(opaque, _scale(pixels[..., 0] / 255, greys), np.nan)


def _scale(share: np.ndarray, greys: Greys) -> np.ndarray:
    return greys.black + share * (greys.white - greys.black)


def _bad(where: str, got: str) -> InputError:
    return InputError(where, expected='a grey picture of one frame', got=got, remedy=PICTURE_REMEDY)
