"""Taxels that stay on after the contact they belonged to is gone."""

import numpy as np

from tactile_node.contact.neighbours import linked
from tactile_node.read_only import read_only

REMAINS = 1 / 3    #: of the contact that a taxel belonged to: less is what is left over
APART = 2          #: taxels between pieces of one contact, at most: silent lines tear it
COMPACT = 0.62     #: a contact whose taxels have more of their sides in common shrinks, what is left over is ragged
FORGOTTEN = 25     #: frames without being pressed after which a taxel begins again: some flicker


class LeftOver:
    """Finds the pressed taxels of a pad that stay on while their surroundings come and go.

    A taxel is left over while it is pressed in a ragged group of at most a third of the taxels of the largest contact
    that it belonged to, pieces close to each other taken as one. A contact that reaches it again clears it. Nothing is
    known of a taxel that was on from the first frame.
    """

    def __init__(self) -> None:
        self._largest = self._idle = np.zeros((0, 0))

    def update(self, pressed: np.ndarray, is_one: bool = False) -> np.ndarray:
        """Return the taxels left over, bool (rows, cols), of successive frames ``pressed``.

        ``is_one``: they are known to be one group, which spares the search.
        """
        if self._largest.shape != pressed.shape:
            self._largest, self._idle = np.zeros((2, *pressed.shape))
        self._idle = np.where(pressed, 0, self._idle + 1)
        self._largest *= self._idle <= FORGOTTEN
        if not np.count_nonzero(pressed):
            return read_only(np.zeros(pressed.shape, bool))
        size, ragged = _group(pressed) if is_one else _groups(pressed)
        left = ragged & (size <= REMAINS * self._largest)
        self._largest = np.maximum(self._largest, size)
        return read_only(left)


def _group(pressed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As `_groups` where all are one group."""
    size = np.count_nonzero(pressed)
    shared = np.count_nonzero(pressed[1:] & pressed[:-1]) + np.count_nonzero(pressed[:, 1:] & pressed[:, :-1])
    return size * pressed, pressed & (shared < COMPACT * 2 * size)


def _groups(pressed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return of each pressed taxel the size of its group and whether that is ragged; 0 and False of others."""
    groups = linked(pressed, APART) * pressed
    count = int(groups.max()) + 1
    sizes = np.bincount(groups.reshape(-1), minlength=count)
    down, along = pressed[1:] & pressed[:-1], pressed[:, 1:] & pressed[:, :-1]
    shared = np.bincount(groups[1:][down], minlength=count) + np.bincount(groups[:, 1:][along], minlength=count)
    ragged = shared < COMPACT * 2 * sizes
    sizes[0], ragged[0] = 0, False
    return sizes[groups], ragged[groups]
