"""Recognise the shapes that a user has taught, with heads stored as arrays in a model file.

A head is a multinomial logistic regression on the embedding of a network. The head compares N taught shapes with
everything else. The networks do not change. The five classes and UNKNOWN share the probability that the head gives to
everything else, in the same proportions as without the head. A taught shape represents one object, so it is reported
only for contacts of about the same size as the taught touches. `tactile teach` fits and writes the heads
(tactile_node/learning).
"""

import re
from collections.abc import Mapping
from hashlib import sha256
from typing import NamedTuple

import numpy as np

from tactile_node.shape.adaptation import is_of_skin
from tactile_node.shape.recognition import Shape, TaughtShape

#: Version of the arrays of taught shapes. The version must change if the embedding changes, because a head fits only
#: one embedding.
HEAD_VERSION = 1
MOST_TAUGHT = 16  #: Largest number of taught shapes in a file.
NAME_FORM = re.compile(r'[a-z][a-z0-9_]{0,31}')
#: Names that a taught shape must not have: the names of the shapes, and of the other codes in ContactShape.msg.
NOT_NAMES = frozenset(shape.value for shape in Shape) | {'other', 'not_known'}
OUTLIER_LIMIT = 5.0  #: Largest magnitude of an element of the standardised embedding.
HEAD_PARTS = 'weights', 'biases', 'middle', 'spread', 'sizes'
#: An array whose name contains one of these is not in the base. Earlier files contain touches.
OWN_PARTS = '_taught_', '_touch_'


class Head(NamedTuple):
    """Head for N taught shapes and one kind of frame, with an embedding of F numbers."""

    weights: np.ndarray  #: (F, N)
    biases: np.ndarray   #: (N,)
    middle: np.ndarray   #: subtracted from the embedding, (F,)
    spread: np.ndarray   #: divisor of (embedding - middle), (F,)

    #: logarithms of the smallest and largest number of taxels for each shape, (N, 2). The range is empty for a shape
    #: that was not taught with this kind of frame.
    sizes: np.ndarray

    def evidence(self, embedding: np.ndarray, log_taxels: np.ndarray) -> np.ndarray:
        """Return the log-odds of each taught shape against everything else.

        Parameters
        ----------
        embedding : np.ndarray
            Embedding of K contacts, (K, F).
        log_taxels : np.ndarray
            Logarithm of the number of taxels of each contact, (K,).

        Returns
        -------
        np.ndarray
            Log-odds, (K, N); -inf if the size of the contact is outside the range of the shape.
        """
        found = self.standard(embedding) @ self.weights + self.biases
        sizes = log_taxels[:, None]
        return np.where((self.sizes[:, 0] <= sizes) & (sizes <= self.sizes[:, 1]), found, -np.inf)

    def standard(self, embedding: np.ndarray) -> np.ndarray:
        """Return (embedding - middle) / spread, (K, F), limited to a magnitude of OUTLIER_LIMIT."""
        return np.clip((embedding - self.middle) / self.spread, -OUTLIER_LIMIT, OUTLIER_LIMIT)


def join(known: np.ndarray, evidence: np.ndarray) -> np.ndarray:
    """Return the probabilities of the known classes and of the taught shapes together.

    Parameters
    ----------
    known : np.ndarray
        Probabilities of the known classes without taught shapes, (K, 6).
    evidence : np.ndarray
        Log-odds of the taught shapes, (K, N), as returned by `Head.evidence`.

    Returns
    -------
    np.ndarray
        Probabilities, (K, 6 + N).

    Examples
    --------
    >>> join(np.array([[0.75, 0.25]]), np.array([[np.log(3)]])).round(4).tolist()
    [[0.1875, 0.0625, 0.75]]
    """
    most = np.maximum(evidence.max(1, keepdims=True), 0)
    rest, taught = np.exp(-most), np.exp(evidence - most)
    return np.concatenate((known * rest, taught), 1) / (rest + taught.sum(1, keepdims=True))


def read_taught(data: Mapping[str, np.ndarray],
                widths: Mapping[str, int]) -> tuple[tuple[TaughtShape, ...], dict[str, Head]]:
    """Return the taught shapes in a model file, and their heads by kind of frame.

    Parameters
    ----------
    data : Mapping[str, np.ndarray]
        Arrays of the file by name.
    widths : Mapping[str, int]
        Number of columns of the embedding for each kind of frame.

    Returns
    -------
    tuple[tuple[TaughtShape, ...], dict[str, Head]]
        The taught shapes and their heads, both empty if the file has no taught shapes.

    Raises
    ------
    ValueError, KeyError, TypeError
        Raised if the arrays differ from those that `tactile teach` writes.
    """
    if not any(name.startswith('taught_') for name in data):
        return (), {}
    version = data['taught_version']
    if version.shape != () or version.dtype.kind not in 'iu' or version != HEAD_VERSION:
        raise ValueError(f'taught shapes of version {version}, not {HEAD_VERSION}')
    names = data['taught_names']
    if names.dtype.kind != 'U' or names.ndim != 1 or not 0 < len(names) <= MOST_TAUGHT:
        raise ValueError(f'taught_names that are not 1 to {MOST_TAUGHT} names')
    wrong = [name for name in names.tolist() if not is_name(name)]
    if wrong or len(set(names.tolist())) < len(names):
        raise ValueError(f'names of taught shapes that cannot be used: {", ".join(map(repr, wrong or names.tolist()))}')
    if str(data['taught_base']) != digest_of(data):
        raise ValueError('shapes taught with weights other than those in the file')
    taught = tuple(map(TaughtShape, names.tolist()))
    heads = {kind: _head(data, kind, len(taught), width) for kind, width in widths.items()
             if f'{kind}_taught_weights' in data}
    if not heads:
        raise ValueError('names of taught shapes without a head')
    return taught, heads


def is_name(name: str) -> bool:
    """Return True if a taught shape may have this name: the name must be lower case and have no other meaning.

    >>> is_name('my_plug'), is_name('circle'), is_name('other'), is_name('My plug')
    (True, False, False, False)
    """
    return NAME_FORM.fullmatch(name) is not None and name not in NOT_NAMES


def digest_of(data: Mapping[str, np.ndarray]) -> str:
    """Return the SHA-256 digest of the base: the arrays of the networks and of their calibrations."""
    found = sha256()
    for name in sorted(data):
        if not is_own(name) and name != 'about':
            array = np.ascontiguousarray(data[name])
            found.update(f'{name} {array.dtype.str} {array.shape}'.encode())
            found.update(array.tobytes())
    return found.hexdigest()


def is_own(name: str) -> bool:
    """Return True if the array with this name belongs to the user's shapes or skin, not to the base."""
    return name.startswith('taught_') or is_of_skin(name) or any(part in name for part in OWN_PARTS)


def _head(data: Mapping[str, np.ndarray], kind: str, count: int, width: int) -> Head:
    arrays = [data[f'{kind}_taught_{part}'] for part in HEAD_PARTS]
    if any(array.dtype.kind != 'f' for array in arrays):
        raise ValueError(f'taught arrays of {kind} that are no numbers')
    head = Head(*(array.astype(np.float32) for array in arrays))
    shapes = [array.shape for array in head]
    if shapes != [(width, count), (count,), (width,), (width,), (count, 2)]:
        raise ValueError(f'taught arrays of {kind} that do not fit together')
    if not all(np.isfinite(array).all() for array in head) or not (head.spread > 0).all():
        raise ValueError(f'a taught array of {kind} with numbers that are not finite, or a spread that is not positive')
    return head
