"""Shapes that a user has taught: a head on the networks' embedding, beside the five classes, and how it is read.

A head is a multinomial logistic regression of N taught shapes against all else. It leaves the networks as they are: of
what it leaves to all else, the five classes and UNKNOWN keep their shares. A taught shape is one object, so it is
answered only for contacts of about the sizes that were taught. `tactile teach` writes it (tactile_node/learning).
"""

import re
from collections.abc import Mapping
from hashlib import sha256
from typing import NamedTuple

import numpy as np

from tactile_node.shape.adaptation import is_of_skin
from tactile_node.shape.recognition import Shape, TaughtShape

HEAD_VERSION = 1      #: version of the arrays below; embeddings of other code are other numbers
MOST_TAUGHT = 16
NAME_FORM = re.compile(r'[a-z][a-z0-9_]{0,31}')
#: Those of shapes, and of the codes of ContactShape.msg that are no shape
NOT_NAMES = frozenset(shape.value for shape in Shape) | {'other', 'not_known'}
OUTLIER_LIMIT = 5.0      #: standard numbers beyond are outliers
HEAD_PARTS = 'weights', 'biases', 'middle', 'spread', 'sizes'
OWN_PARTS = '_taught_', '_touch_'  #: in the names of arrays that are no part of the base


class Head(NamedTuple):
    """Head for one kind of frames, for N shapes and embeddings of F numbers."""

    weights: np.ndarray  #: (F, N)
    biases: np.ndarray   #: (N,)
    middle: np.ndarray   #: (F,) and
    spread: np.ndarray   #: (F,): the embedding is used as (embedding - middle) / spread
    sizes: np.ndarray    #: (N, 2), log of the least and the largest number of taxels; an empty range: not taught

    def evidence(self, embedding: np.ndarray, log_taxels: np.ndarray) -> np.ndarray:
        """Return the log of the odds of each shape to all else, (K, N); -inf beyond its sizes."""
        found = self.standard(embedding) @ self.weights + self.biases
        sizes = log_taxels[:, None]
        return np.where((self.sizes[:, 0] <= sizes) & (sizes <= self.sizes[:, 1]), found, -np.inf)

    def standard(self, embedding: np.ndarray) -> np.ndarray:
        """Return (embedding - middle) / spread, (K, F), outliers within OUTLIER_LIMIT."""
        return np.clip((embedding - self.middle) / self.spread, -OUTLIER_LIMIT, OUTLIER_LIMIT)


def join(known: np.ndarray, evidence: np.ndarray) -> np.ndarray:
    """Join probabilities of the known classes (K, 6) and log-odds of N taught shapes (K, N) to (K, 6 + N).

    >>> join(np.array([[0.75, 0.25]]), np.array([[np.log(3)]])).round(4).tolist()
    [[0.1875, 0.0625, 0.75]]
    """
    most = np.maximum(evidence.max(1, keepdims=True), 0)
    rest, taught = np.exp(-most), np.exp(evidence - most)
    return np.concatenate((known * rest, taught), 1) / (rest + taught.sum(1, keepdims=True))


def read_taught(data: Mapping[str, np.ndarray],
                widths: Mapping[str, int]) -> tuple[tuple[TaughtShape, ...], dict[str, Head]]:
    """Return the taught shapes and their heads by kind of frames; none of a file without.

    ``widths``: of the embedding of each kind. Raises ValueError, KeyError, TypeError where the arrays are no heads.
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
        raise ValueError('shapes taught on other weights than those of the file')
    taught = tuple(map(TaughtShape, names.tolist()))
    heads = {kind: _head(data, kind, len(taught), width) for kind, width in widths.items()
             if f'{kind}_taught_weights' in data}
    if not heads:
        raise ValueError('names of taught shapes without a head')
    return taught, heads


def is_name(name: str) -> bool:
    """Return whether ``name`` may be that of a taught shape: lower case, and none that has another meaning.

    >>> is_name('my_plug'), is_name('circle'), is_name('other'), is_name('My plug')
    (True, False, False, False)
    """
    return NAME_FORM.fullmatch(name) is not None and name not in NOT_NAMES


def digest_of(data: Mapping[str, np.ndarray]) -> str:
    """Return the SHA-256 of the arrays of the base, those of networks and calibrations."""
    found = sha256()
    for name in sorted(data):
        if not is_own(name) and name != 'about':
            array = np.ascontiguousarray(data[name])
            found.update(f'{name} {array.dtype.str} {array.shape}'.encode())
            found.update(array.tobytes())
    return found.hexdigest()


def is_own(name: str) -> bool:
    """Return whether an array is of the user's shapes or skin, not of the base."""
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
