"""Taxels that stay on after the contact they belonged to is gone."""

import numpy as np

from tactile_node.contact.neighbours import linked
from tactile_node.taxel_frame import read_only

REMAINING_SHARE = 1 / 3    #: share of the contact that a taxel belonged to: less is what is left over
RELEASE_FRAMES = 15  #: frames in which a contact that falls to REMAINING_SHARE of its size is let go; 0.3 s at 50 Hz
RETURN_GROWTH = 2          #: times what was left over: a contact again
PIECES_APART = 2          #: taxels between pieces of one contact, at most: silent lines tear it
LEAST_COMPACTNESS = 0.62  #: fraction of a contact's sides in common; what is left over, or by chance, is ragged
IDLE_FRAMES = 25     #: frames without being pressed after which a taxel begins again: some flicker


class LeftOver:
    """Finds the pressed taxels of a pad that stay on while their surroundings come and go.

    A taxel is left over while it is pressed in a group of at most a third of the taxels of the largest contact that it
    belonged to, pieces close to each other taken as one, if the group is ragged, or if all of it fell so low within
    RELEASE_FRAMES: an object that leaves more slowly is followed. A contact that reaches it again clears it, and so
    does a fallen group that grows. Nothing is known of a taxel that was on from the first frame.
    """

    def __init__(self) -> None:
        self._largest = self._recent = self._idle = self._since = self._left = np.zeros((0, 0))

    def update(self, pressed: np.ndarray, is_one: bool = False) -> np.ndarray:
        """Return the taxels left over, bool (rows, cols), of successive frames ``pressed``.

        ``is_one``: they are known to be one group, which spares the search.
        """
        if self._largest.shape != pressed.shape:
            self._largest, self._recent, self._idle, self._since, self._left = np.zeros((5, *pressed.shape))
        self._idle = np.where(pressed, 0, self._idle + 1)
        self._since += 1
        self._largest *= self._idle <= IDLE_FRAMES
        self._recent *= self._since <= RELEASE_FRAMES
        if not np.count_nonzero(pressed):
            self._left = read_only(np.zeros(pressed.shape, bool))
            return self._left
        groups = pressed.astype(int) if is_one else linked(pressed, PIECES_APART) * pressed
        sizes, ragged = _sizes(pressed, groups)
        size = sizes[groups]
        fallen = np.bincount(groups[pressed & (size <= REMAINING_SHARE * self._recent)], minlength=len(sizes)) == sizes
        left = pressed & (fallen[groups] | ragged[groups] & (size <= REMAINING_SHARE * self._largest))
        self._largest = np.maximum(self._largest, size)
        most = np.where(left, RETURN_GROWTH / REMAINING_SHARE * size, np.inf)
        self._recent = np.maximum(np.minimum(self._recent, most), size)
        self._since[left | (self._recent == size)] = 0
        self._left = read_only(left)
        return self._left

    def keep_only_left_over(self) -> None:
        """Forget all but the taxels left over now: a contact that new thresholds make smaller has not been let go."""
        self._largest = self._largest * self._left
        self._recent = self._recent * self._left


def _sizes(pressed: np.ndarray, groups: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the size of each group and whether it is ragged; 0 and False of number 0."""
    count = int(groups.max()) + 1
    sizes = np.bincount(groups.reshape(-1), minlength=count)
    down, along = pressed[1:] & pressed[:-1], pressed[:, 1:] & pressed[:, :-1]
    shared = np.bincount(groups[1:][down], minlength=count) + np.bincount(groups[:, 1:][along], minlength=count)
    ragged = shared < LEAST_COMPACTNESS * 2 * sizes
    sizes[0], ragged[0] = 0, False
    return sizes, ragged
