"""Whether a pad was seen: only then is one without a contact empty."""

import numpy as np
from scipy import ndimage

from tactile_node.contact.press import SMALLEST_CONTACT as SMALLEST_CONTACT
from tactile_node.read_only import read_only

EIGHT_CONNECTED = read_only(np.ones((3, 3), bool))


def pad_seen(hidden: np.ndarray, unmapped: np.ndarray, smallest_contact: int = SMALLEST_CONTACT) -> bool:
    """Return whether no 8-connected group of ``hidden`` taxels has room for ``smallest_contact`` taxels.

    A line is a contact, too: one lost TPDO of eight taxels in a row can hide a bar. A pad without any visible taxel is
    not seen.

    >>> hidden = np.zeros((4, 4), bool)
    >>> hidden[1, :3] = True
    >>> pad_seen(hidden, np.zeros((4, 4), bool)), pad_seen(hidden, np.zeros((4, 4), bool), smallest_contact=3)
    (True, False)
    """
    if (hidden | unmapped).all():
        return False
    return largest_group(hidden) < smallest_contact


def largest_group(taxels: np.ndarray, reaching: np.ndarray | None = None) -> int:
    """Return the size of the largest 8-connected group of ``taxels`` that has one of ``reaching``; 0 without any."""
    if not taxels.any():
        return 0
    labels, _ = ndimage.label(taxels, EIGHT_CONNECTED)
    sizes = np.bincount(labels.reshape(-1))
    sizes[0] = 0
    reached = sizes if reaching is None else sizes[labels[reaching & taxels]]
    return int(reached.max(initial=0))
