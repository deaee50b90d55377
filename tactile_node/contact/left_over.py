"""Find left-over taxels, which stay pressed after the contact they belonged to is gone."""

import numpy as np

from tactile_node.contact.neighbours import linked
from tactile_node.taxel_frame import read_only

REMAINING_SHARE = 1 / 3  #: A group can be left over if it has at most this share of the taxels of its former contact.

#: Time within which a contact must shrink to REMAINING_SHARE to count as released [frames]; 0.3 s at 50 Hz.
RELEASE_FRAMES = 15
RETURN_GROWTH = 2  #: Factor by which a left-over group must grow to count as a contact again.

#: Largest gap between pieces of one contact [taxels]. Silent lines of taxels split a contact into pieces.
PIECES_APART = 2
#: Smallest share of a contact's taxel sides that lie between two of its taxels. Left-over groups and random
#: groups are ragged and have a smaller share.
LEAST_COMPACTNESS = 0.62
#: Time after which the history of a taxel that is no longer pressed is forgotten [frames]. A shorter time would forget
#: taxels that flicker.
IDLE_FRAMES = 25


class LeftOver:
    """Finds the left-over taxels of a pad in successive frames.

    A pressed taxel is left over if its group is much smaller than the contact that the taxel belonged to before, and
    the group also looks like a remainder:

    - The group has at most a third (REMAINING_SHARE) of the taxels of the largest contact that the taxel belonged to.
      Pieces that are close to each other count as one group.

    - The group is ragged, or all of its taxels were part of a contact that shrank to that size within RELEASE_FRAMES. A
      contact that shrinks more slowly remains a contact.

    Left-over taxels become a contact again when a contact reaches them, or when a group that shrank grows by
    RETURN_GROWTH. If a taxel was pressed in the first frame, its earlier contact is unknown, so the taxel cannot be
    found left over.
    """

    def __init__(self) -> None:
        self._largest = self._recent = self._idle = self._since = self._left = np.zeros((0, 0))

    def update(self, pressed: np.ndarray, is_one: bool = False) -> np.ndarray:
        """Return the left-over taxels after one more frame.

        Parameters
        ----------
        pressed : np.ndarray
            Pressed taxels of the frame, bool (rows, cols).
        is_one : bool
            True if the caller knows that ``pressed`` is a single group. With True, the search for groups is skipped.

        Returns
        -------
        np.ndarray
            Left-over taxels, bool (rows, cols), read-only.
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
        """Forget all contacts except the present left-over taxels.

        Call this when thresholds change, because a contact that becomes smaller under new thresholds has not been
        released.
        """
        self._largest = self._largest * self._left
        self._recent = self._recent * self._left


def _sizes(pressed: np.ndarray, groups: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the size of each group, and an array that is True for each ragged group.

    Group 0 holds the taxels outside all groups. The size of group 0 is 0, and group 0 is not ragged.
    """
    count = int(groups.max()) + 1
    sizes = np.bincount(groups.reshape(-1), minlength=count)
    down, along = pressed[1:] & pressed[:-1], pressed[:, 1:] & pressed[:, :-1]
    shared = np.bincount(groups[1:][down], minlength=count) + np.bincount(groups[:, 1:][along], minlength=count)
    ragged = shared < LEAST_COMPACTNESS * 2 * sizes
    sizes[0], ragged[0] = 0, False
    return sizes, ragged
