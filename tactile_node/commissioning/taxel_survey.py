"""Find faulty taxels, which stay at one value while their neighbours move, and taxels that nothing pressed."""

from collections.abc import Iterable
from enum import IntEnum

import numpy as np
from scipy import ndimage

PRESSED = 0.02       #: Change of a taxel that a press causes [N].
NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]])
LEAST_PRESSED = 0.6  #: Share of the neighbours that must have been pressed before a still taxel counts as faulty.


class TaxelFinding(IntEnum):
    """Finding about a taxel after all presses."""

    UNKNOWN = 0  #: nothing pressed the taxel
    WORKS = 1
    FAULTY = 2   #: the taxel stayed at one value while its neighbours moved


def survey(frames: Iterable[np.ndarray]) -> np.ndarray:
    """Return the TaxelFinding of each taxel, (rows, cols).

    Parameters
    ----------
    frames : iterable of np.ndarray
        Force on each taxel in the frames of one or more recordings, (K, rows, cols) [N].
    """
    everything = np.concatenate(list(frames))
    span = np.ptp(np.nan_to_num(everything), axis=0)
    moves = span >= PRESSED
    around = ndimage.convolve(moves.astype(float), NEIGHBOURS, mode='constant')
    possible = ndimage.convolve(np.ones_like(around), NEIGHBOURS, mode='constant')
    found = np.where(moves, TaxelFinding.WORKS, TaxelFinding.UNKNOWN)
    found[(span == 0) & (around >= LEAST_PRESSED * possible)] = TaxelFinding.FAULTY
    return found
