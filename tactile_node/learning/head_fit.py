"""Fit the head of the taught shapes: a multinomial logistic regression on the embedding of the networks.

All other classes together have the logit 0. Some foreign contacts of the background may have the same shape as a taught
object, for example a cross if a cross is taught. A first fit identifies these contacts, and a second fit excludes them.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize

from tactile_node.learning.background import FOREIGN, Seen
from tactile_node.shape.taught import Head
from tactile_node.taxel_frame import read_only

#: Penalty on the weights. The constants from RIDGE_WEIGHT to LARGER_SIZE were chosen on validation touches.
RIDGE_WEIGHT = 1e-3
EXAMPLE_SHARE = 0.25  #: Weight of all examples of one shape, as a share of the background's weight.
FOREIGN_WEIGHT = 0.5  #: Weight of a foreign contact.
SMALLER_SIZE = 0.8    #: Smallest recognised number of taxels, as a multiple of the smallest taught number.
LARGER_SIZE = 1.25    #: Largest recognised number of taxels, as a multiple of the largest taught number.
MOST_ITERATIONS = 200


def fit_head(background: Seen, labels: np.ndarray, shapes: Sequence[Seen]) -> Head:
    """Return the head for the taught shapes. The head never reports a shape without examples.

    Parameters
    ----------
    background : Seen
        Background contacts.
    labels : np.ndarray
        Label of each background contact, (K,).
    shapes : sequence of Seen
        Examples of each taught shape.
    """
    middle, spread = background.embedding.mean(0), background.embedding.std(0) + 1e-3
    head = Head(np.zeros((len(middle), len(shapes))), np.zeros(len(shapes)), middle, spread,
                np.array([_sizes(each) for each in shapes]))
    counts = [len(labels), *(len(each.log_taxels) for each in shapes)]
    inputs = np.concatenate([head.standard(each.embedding) for each in (background, *shapes) if len(each.log_taxels)])
    targets = np.repeat(np.arange(len(counts)), counts)
    of_background = np.where(labels == FOREIGN, FOREIGN_WEIGHT, 1.0)
    weights = np.concatenate([of_background, *(np.full(count, EXAMPLE_SHARE * of_background.sum() / max(count, 1))
                                               for count in counts[1:])])
    head = _fitted(head, inputs, targets, weights)
    is_alike = (head.standard(background.embedding) @ head.weights + head.biases > 0).any(1) & (labels == FOREIGN)
    weights[:len(labels)][is_alike] = 0.0
    found = _fitted(head, inputs, targets, weights)
    return Head(*(read_only(np.asarray(array, np.float32)) for array in found))


def _sizes(seen: Seen) -> tuple[float, float]:
    if not len(seen.log_taxels):
        return 1.0, 0.0
    return float(seen.log_taxels.min() + np.log(SMALLER_SIZE)), float(seen.log_taxels.max() + np.log(LARGER_SIZE))


def _fitted(head: Head, inputs: np.ndarray, targets: np.ndarray, weights: np.ndarray) -> Head:
    """Return the head after a fit that starts from ``head``."""
    inputs = np.column_stack((inputs, np.ones(len(inputs))))
    count = head.weights.shape[1]
    is_target = targets[:, None] == np.arange(1, count + 1)
    share = weights / weights.sum()
    rows = np.arange(len(targets))

    def loss(flat: np.ndarray) -> tuple[float, np.ndarray]:
        matrix = flat.reshape(-1, count)
        logits = np.column_stack((np.zeros(len(inputs)), inputs @ matrix))
        logits -= logits.max(1, keepdims=True)
        odds = np.exp(logits)
        total = odds.sum(1)
        ridge = RIDGE_WEIGHT * matrix
        ridge[-1] = 0
        value = share @ (np.log(total) - logits[rows, targets]) + (ridge * matrix).sum() / 2
        slope = inputs.T @ ((odds[:, 1:] / total[:, None] - is_target) * share[:, None]) + ridge
        return float(value), slope.reshape(-1)

    start = np.vstack((head.weights, head.biases)).reshape(-1)
    found = minimize(loss, start, jac=True, method='L-BFGS-B', options={'maxiter': MOST_ITERATIONS}).x
    found = found.reshape(-1, count)
    return head._replace(weights=found[:-1], biases=found[-1])
