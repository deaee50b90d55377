"""Provide array operations on neighbouring taxels, and check that a frame shows enough of the pad."""

import numpy as np
from scipy import ndimage

from tactile_node.contact.press import SMALLEST_CONTACT
from tactile_node.taxel_frame import SkinSide, read_only

EIGHT_CONNECTED = read_only(np.ones((3, 3), bool))


def pad_seen(hidden: np.ndarray, unmapped: np.ndarray, smallest_contact: int = SMALLEST_CONTACT) -> bool:
    """Return True if no group of connected hidden taxels has room for a contact.

    A line of taxels can also be a contact. One lost TPDO that carries eight taxels of a row can therefore hide a bar. A
    pad without any visible taxel does not count as seen.

    Parameters
    ----------
    hidden : np.ndarray
        Taxels of the pad without a valid value, bool (rows, cols).
    unmapped : np.ndarray
        Places without a taxel, bool (rows, cols).
    smallest_contact : int
        Size of the smallest contact that is reported [taxels].

    Returns
    -------
    bool
        True if each 8-connected group of hidden taxels has fewer than ``smallest_contact`` taxels.

    Examples
    --------
    >>> hidden = np.zeros((4, 4), bool)
    >>> hidden[1, :3] = True
    >>> pad_seen(hidden, np.zeros((4, 4), bool)), pad_seen(hidden, np.zeros((4, 4), bool), smallest_contact=3)
    (True, False)
    """
    if np.count_nonzero(hidden | unmapped) == hidden.size:
        return False
    return largest_group(hidden) < smallest_contact


def largest_group(taxels: np.ndarray, reaching: np.ndarray | None = None) -> int:
    """Return the size of the largest 8-connected group of ``taxels`` that shares a taxel with ``reaching``, or 0.

    If ``reaching`` is None, all groups count.
    """
    if not np.count_nonzero(taxels):
        return 0
    labels, _ = ndimage.label(taxels, EIGHT_CONNECTED)
    sizes = np.bincount(labels.reshape(-1))
    sizes[0] = 0
    reached = sizes if reaching is None else sizes[labels[reaching & taxels]]
    return int(reached.max(initial=0))


def grown(mask: np.ndarray) -> np.ndarray:
    """Return ``mask``, bool (rows, cols), extended by the 8 neighbours of each of its taxels.

    >>> grown(np.array([[True, False, False]])).tolist()
    [[True, True, False]]
    """
    if not np.count_nonzero(mask):
        return np.zeros(mask.shape, bool)
    wide = framed(mask)
    tall = wide[:-2] | wide[1:-1]
    tall |= wide[2:]
    around: np.ndarray = tall[:, :-2] | tall[:, 1:-1]
    around |= tall[:, 2:]
    return around


def framed(taxels: np.ndarray) -> np.ndarray:
    """Return ``taxels`` with a row or column of zeros added on each side (five times as fast as `numpy.pad`).

    >>> framed(np.array([[7]])).tolist()
    [[0, 0, 0], [0, 7, 0], [0, 0, 0]]
    """
    rows, cols = taxels.shape
    wide = np.zeros((rows + 2, cols + 2), taxels.dtype)
    wide[1:-1, 1:-1] = taxels
    return wide


def enclosed(mask: np.ndarray) -> np.ndarray:
    """Return the taxels that lie between two taxels of ``mask`` in their row or column, each at most 2 taxels away.

    ``mask`` and the result are bool (rows, cols).

    >>> enclosed(np.array([[True, False, False, True, False, False, False, True]]))[0].nonzero()[0].tolist()
    [1, 2, 5]
    """
    return _enclosed_along_rows(mask) | _enclosed_along_rows(mask.T).T


def _enclosed_along_rows(mask: np.ndarray) -> np.ndarray:
    rows, cols = mask.shape
    wide = np.zeros((rows, cols + 4), bool)
    wide[:, 2:-2] = mask
    return (wide[:, :-4] | wide[:, 1:-3]) & (wide[:, 3:-1] | wide[:, 4:])


def box_of(mask: np.ndarray, margin: int = 0) -> tuple[slice, slice]:
    """Return the smallest box of rows and columns that contains all taxels of ``mask``.

    Parameters
    ----------
    mask : np.ndarray
        bool (rows, cols), with at least one taxel set.
    margin : int
        Number of rows and columns to add on each side. The box never begins before row or column 0, but may extend
        beyond the last one, because numpy shortens slices.

    Returns
    -------
    tuple of slice
        Rows and columns of the box.

    Examples
    --------
    >>> box_of(np.eye(4, dtype=bool)[:, 1:])
    (slice(1, 4, None), slice(0, 3, None))
    """
    taxels, cols, width = mask.tobytes(), np.logical_or.reduce(mask, 0).tobytes(), mask.shape[1]
    return (slice(max(taxels.find(1) // width - margin, 0), taxels.rfind(1) // width + margin + 1),
            slice(max(cols.find(1) - margin, 0), cols.rfind(1) + margin + 1))


def touches_edge(mask: np.ndarray) -> bool:
    """Return True if ``mask``, bool (rows, cols), has a taxel in the first or last row or column.

    >>> touches_edge(np.pad(np.ones((2, 2), bool), 1)), touches_edge(np.eye(3, dtype=bool))
    (False, True)
    """
    return any(map(np.count_nonzero, (mask[0], mask[-1], mask[:, 0], mask[:, -1])))


def sides_reached(mask: np.ndarray) -> SkinSide:
    """Return the sides of the pad at which ``mask``, bool (rows, cols), has a taxel.

    >>> sides_reached(np.array([[False, True], [False, False]])) == SkinSide.FIRST_ROW | SkinSide.LAST_COL
    True
    """
    ends = zip(SkinSide, (mask[0], mask[-1], mask[:, 0], mask[:, -1]))
    return SkinSide(sum(side for side, taxels in ends if np.count_nonzero(taxels)))


def sum_around(values: np.ndarray) -> np.ndarray:
    """Return, for each taxel, the sum of its value and the values of its 8 neighbours, float (rows, cols).

    ``values`` may be numbers or bool. Places beyond the edge of the pad count as 0.

    >>> sum_around(np.array([[1.0, 2.0, 4.0]])).tolist()
    [[3.0, 7.0, 6.0]]
    """
    tall = values.astype(float)
    tall[1:] += values[:-1]
    tall[:-1] += values[1:]
    around = tall.copy()
    around[:, 1:] += tall[:, :-1]
    around[:, :-1] += tall[:, 1:]
    return around


def reached(start: np.ndarray, taxels: np.ndarray) -> np.ndarray:
    """Return the groups of ``taxels`` that share a taxel with ``start``; all arrays are bool (rows, cols).

    >>> reached(np.array([[True, False, False, False]]), np.array([[True, True, False, True]]))[0].tolist()
    [True, True, False, False]
    """
    groups, count = ndimage.label(taxels, EIGHT_CONNECTED)
    of_start = np.bincount(groups[start], minlength=count + 1) > 0
    found: np.ndarray = of_start[groups]
    return found


def linked(taxels: np.ndarray, between: int) -> np.ndarray:
    """Number the groups of taxels. A small gap does not separate two groups.

    Parameters
    ----------
    taxels : np.ndarray
        bool (rows, cols).
    between : int
        Largest number of other taxels between two taxels of one group.

    Returns
    -------
    np.ndarray
        Group number of each taxel, int (rows, cols). Taxels outside all groups have the number 0. Taxels in the gaps
        may have a group number.

    Examples
    --------
    >>> linked(np.array([[True, False, True, False, False, True]]), 1)[0, [0, 2, 5]].tolist()
    [1, 1, 2]
    """
    if between == 2:
        wide = grown(taxels)
    else:
        wide = ndimage.maximum_filter(taxels.view(np.uint8), between + 1, mode='constant')
    return ndimage.label(wide, EIGHT_CONNECTED)[0]
