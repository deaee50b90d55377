"""Maximise a function without derivatives, from many starts at once."""

from collections.abc import Callable

import numpy as np

#: Function that returns the values, (m,), of poses, (m, p). The second argument is the index of the start of each pose.
Function = Callable[[np.ndarray, np.ndarray], np.ndarray]
#: Possible moves of the worst corner: reflected, expanded, contracted outside and contracted inside.
STEPS = np.array((1.0, 2.0, 0.5, -0.5))[:, None]


def maximised(function: Function, starts: np.ndarray, spread: np.ndarray,
              steps: int, enough: float = 1e-4) -> tuple[np.ndarray, np.ndarray]:
    """Return the best poses, (s, p), and their values, (s,), after up to ``steps`` steps of the simplex method.

    The ``starts``, (s, p), are the first corners. The ``spread``, (p,), is the extent of the first simplex. In each
    step, the function evaluates all four possible poses together. The iteration ends once the corners of every simplex
    differ by less than ``enough``. The method is described by Nelder and Mead (Computer Journal 7, 308, 1965).

    >>> def function(poses, start):
    ...     return -((poses - 1.0) ** 2).sum(1)
    >>> maximised(function, np.zeros((1, 2)), np.full(2, 0.5), steps=90, enough=1e-9)[0].round(3)
    array([[1., 1.]])
    """
    count, size = starts.shape
    number = np.arange(count)
    simplices = np.repeat(starts[:, None], size + 1, 1)
    simplices[:, 1:] += np.diag(spread)
    values = _evaluated(function, simplices, number)
    for _ in range(steps):
        if (np.ptp(values, axis=1) < enough).all():
            break
        order = np.argsort(-values, 1)
        simplices, values = simplices[number[:, None], order], np.take_along_axis(values, order, 1)
        middle = simplices[:, :-1].mean(1, keepdims=True)
        tried = middle + STEPS * (middle - simplices[:, -1:])
        found = _evaluated(function, tried, number)
        chosen = _choice(found, values)
        better = chosen >= 0
        simplices[better, -1], values[better, -1] = tried[better, chosen[better]], found[better, chosen[better]]
        shrinking = number[~better]
        if len(shrinking):
            simplices[shrinking, 1:] = (simplices[shrinking, 1:] + simplices[shrinking, :1]) / 2
            values[shrinking, 1:] = _evaluated(function, simplices[shrinking, 1:], shrinking)
    best = values.argmax(1)
    return simplices[number, best], values[number, best]


def _evaluated(function: Function, poses: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return the values, (s, k), of poses, (s, k, p)."""
    return function(poses.reshape(-1, poses.shape[-1]), np.repeat(start, poses.shape[1])).reshape(poses.shape[:2])


def _choice(found: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the index of the pose that replaces the worst corner of each simplex, or -1 if the simplex shrinks."""
    reflected, expanded, outside, inside = found.T
    far = np.where(expanded > reflected, 1, 0)
    near = np.where(reflected > values[:, -1], np.where(outside >= reflected, 2, -1),
                    np.where(inside > values[:, -1], 3, -1))
    chosen: np.ndarray = np.where(reflected > values[:, 0], far, np.where(reflected > values[:, -2], 0, near))
    return chosen
