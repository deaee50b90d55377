"""An array of taxel values -> its contact, its features, its shape with pose and size."""

from pathlib import Path

import numpy as np

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.helmholtz.features import Features, Group, compute_features
from tactile_node.pose import fit
from tactile_node.pose.fit import ShapeFit
from tactile_node.shape.methods import DEFAULT, make_recogniser
from tactile_node.shape.recognition import Recognition, Shape


def find_contact(values: np.ndarray, unit: str | None = 'Pa',
                 thresholds: PressThresholds | None = None) -> ContactPattern:
    """Return the largest contact of one frame; ``values`` are real numbers or bool, shape (rows, cols), NaN = invalid.

    ``unit``: 'Pa', 'N' or '1' (on/off), each with its own thresholds; None: an array without a unit, whose
    thresholds are fractions of its largest value. ``thresholds`` replace them. A bool array says itself what is
    pressed. Raises InputError for another array, ConfigurationError for another unit.

    >>> import numpy as np
    >>> int(find_contact(np.pad(np.full((2, 3), 50e3), 1)).mask.sum())  # taxels pressed together
    6
    """
    return PatternExtractor(thresholds or default_thresholds(values, unit)).extract(values)


def default_thresholds(values: np.ndarray, unit: str | None) -> PressThresholds:
    """Return the thresholds of ``unit``; without one, fractions of the largest valid value."""
    if unit is not None:
        return PressThresholds.of_unit(unit)
    numbers = np.asarray(values, float)
    return PressThresholds.of_full_scale(float(numbers[np.isfinite(numbers)].max(initial=0.0)))


def paper_features(contact: ContactPattern, groups: Group = Group.ALL) -> Features:
    """Return the quantities of Volf, Dvořák and Vlček for ``contact``, by name; ``groups`` limits them.

    >>> import numpy as np
    >>> features = paper_features(find_contact(np.array([[True, False], [True, True]])))
    >>> features.values['N'], round(features.values['lambda5'], 6)
    (3, 2.585786)
    """
    return compute_features(contact.mask, groups)


class Recogniser:
    """Recognises the shape of a contact; reads its weights once, when it is made.

    ``method``: 'learned', or 'volf' for the paper's three planes. ``file``: other weights or curves than the
    package's own. Raises ConfigurationError for a method that is none, or a file that cannot be used.

    >>> import numpy as np
    >>> Recogniser().recognise(find_contact(np.pad(np.full((7, 7), 50e3), 4))).shape.value
    'square'
    """

    def __init__(self, method: str = DEFAULT, file: str | Path = ''):
        self._method = make_recogniser(method, str(file))

    def recognise(self, contact: ContactPattern) -> Recognition:
        """Return the most probable shape and the probability of each."""
        return self._method.recognise(contact)


def fit_shape(contact: ContactPattern, shape: Shape, pitch: float = 1.0) -> ShapeFit | None:
    """Return pose and size of ``contact`` as a ``shape``, with covariance; None for NONE and UNKNOWN.

    ``pitch``: distance of neighbouring taxels; all lengths come in its unit. Values that are all 0 or 1 are taken as
    on/off. Raises InputError where the contact has no taxel.

    >>> import numpy as np
    >>> found = fit_shape(find_contact(np.pad(np.full((7, 7), 50e3), 4)), Shape.SQUARE, pitch=0.004)
    >>> [round(1000 * length, 1) for length in (*found.centre, *found.dimensions)]
    [28.0, 28.0, 28.0]
    """
    finite = contact.values[np.isfinite(contact.values)]
    is_on_off = bool(((finite == 0) | (finite == 1)).all())
    return fit.fit_shape(contact.mask if is_on_off else contact.values, contact.mask, shape, pitch)
