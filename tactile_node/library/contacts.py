"""An array of taxel values -> its contact, its features, its shape with pose and size."""

from pathlib import Path

from numpy.typing import ArrayLike

from tactile_node.calibration.response import SkinResponse
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import PressThresholds
from tactile_node.helmholtz.features import Features, Group, compute_features
from tactile_node.library.arguments import checked_frame, extractor_by, instance, known_response, known_shape
from tactile_node.pose import box
from tactile_node.pose.box import ContactBox
from tactile_node.pose.contact_fit import fit_contact
from tactile_node.pose.fit import ShapeFit
from tactile_node.shape.methods import DEFAULT, make_recogniser
from tactile_node.shape.patch import join_pieces
from tactile_node.shape.recognition import Recognition, ShapeClass


def find_contact(values: ArrayLike, unit: str | None = '',
                 thresholds: PressThresholds | None = None, *, saturated: ArrayLike | None = None,
                 unmapped: ArrayLike | None = None) -> ContactPattern:
    """Return the largest contact of one frame; ``values`` are real numbers or bool, shape (rows, cols).

    NaN, infinite and masked taxels have no valid value: they are hidden, and a pad of which too much is hidden is not
    seen (`pad_seen`), so that 0 contacts do not mean that it is empty. ``unmapped`` (bool): places without a taxel,
    which hide nothing. ``saturated`` (bool): values that are lower bounds. A bool array is itself the pressed taxels.
    Pressed is what stands out of the noise of the taxels at rest, of which there must be a quarter, up to where it
    reads half of its contact. ``unit``: 'Pa' (from 2 kPa on), 'N' (from 7 mN) or '1' (on/off). None: no unit, as of
    counts; values that are 0 and a single other are on/off. '': as None, but integers are refused. ``thresholds``
    replace this rule by fixed values.

    >>> import numpy as np
    >>> int(find_contact(np.pad(np.full((2, 3), 50e3), 1), 'Pa').mask.sum())  # taxels pressed together
    6

    Raises InputError for another array, for integers without a unit and for a contact that is far too low for its unit,
    as counts are; ConfigurationError for another unit.
    """
    extractor, scale = extractor_by(unit, thresholds)
    return extractor.extract(checked_frame(values, scale), saturated=saturated, unmapped=unmapped)


def paper_features(contact: ContactPattern, groups: Group = Group.ALL) -> Features:
    """Return the quantities of Volf, Dvořák and Vlček for ``contact``, by name; ``groups`` limits them.

    Lengths are in taxels, angles in degrees; the names are those of `tactile features`. Raises InputError for
    something else than a contact.

    >>> import numpy as np
    >>> features = paper_features(find_contact(np.array([[True, False], [True, True]])))
    >>> features.values['N'], round(features.values['lambda5'], 6)
    (3, 2.585786)
    """
    instance(groups, Group, 'groups', 'Pass Group.ALL, or some of its members joined by |.')
    return compute_features(_contact(contact).mask, groups)


class Recogniser:
    """Recognises the shape of a contact; reads its weights once, when it is made.

    ``method``: 'learned', or 'volf' for the paper's three planes. ``file``: other weights or curves than the
    package's own, such as one of `tactile teach`. Raises ConfigurationError for an unknown method or a file that
    cannot be used.

    >>> import numpy as np
    >>> Recogniser().recognise(find_contact(np.pad(np.full((7, 7), 50e3), 4))).shape.value
    'square'
    """

    def __init__(self, method: str = DEFAULT, file: str | Path | None = None):
        self._method = make_recogniser(method, str(file or ''))

    @property
    def classes(self) -> tuple[ShapeClass, ...]:
        """Every class that a recognition gives a probability, taught shapes last."""
        return self._method.classes

    def recognise(self, contact: ContactPattern) -> Recognition:
        """Return the most probable shape and the probability of each. Raises InputError for anything but a contact.

        NONE where the pad was seen and nothing presses it. `reason` says why a shape is UNKNOWN: not seen, unfamiliar
        or too small. Where hidden taxels could change the answer, its confidence stays below 0.9.
        """
        return self._method.recognise(_contact(contact))


def recognised(recogniser: Recogniser, contact: ContactPattern) -> tuple[ContactPattern, Recognition]:
    """Return the recognition of ``contact``, and the contact that it is of: with the pieces that are torn off it."""
    found = recogniser.recognise(contact)
    return (join_pieces(contact) if found.joined else contact), found


def fit_shape(contact: ContactPattern, shape: ShapeClass, pitch: float = 1.0,
              response: str | Path | SkinResponse | None = None) -> ShapeFit | None:
    """Return pose and size of ``contact`` as a ``shape``, with covariance; None for NONE, UNKNOWN and TaughtShapes.

    ``pitch``: distance of neighbouring taxels; all lengths come in its unit. Values that are 0 or one other number are
    taken as on/off. ``response``: file of `tactile calibrate`, whose curve the values have already passed; lengths in
    metres. Raises InputError where the contact has no taxel, or for an unknown shape; ConfigurationError for
    a pitch that is no length > 0.

    >>> import numpy as np
    >>> from tactile_node import Shape
    >>> found = fit_shape(find_contact(np.pad(np.full((7, 7), 50e3), 4)), Shape.SQUARE, pitch=0.004)
    >>> [round(1000 * length) for length in (*found.centre, *found.dimensions)]
    [28, 28, 28]
    """
    shape = known_shape(shape)
    known = known_response(response)
    return fit_contact(_contact(contact), shape, pitch, None if known is None else known.layer)


def contact_box(contact: ContactPattern, pitch: float = 1.0) -> ContactBox:
    """Return the least rectangle around ``contact``, whatever its shape, with deviations; NaN without a contact.

    ``pitch`` as in `fit_shape`. What the pad's edge or hidden taxels cut is a bound. Raises InputError for something
    else than a contact, ConfigurationError for a pitch that is no length > 0.

    >>> import numpy as np
    >>> box = contact_box(find_contact(np.pad(np.full((3, 9), 50e3), 4)), pitch=0.004)
    >>> [round(1000 * length) for length in box.lengths], box.length_is_bound
    ([36, 12], (False, False))
    """
    return box.contact_box(_contact(contact), pitch)


def _contact(contact: object) -> ContactPattern:
    return instance(contact, ContactPattern, 'contact', 'Pass what find_contact returns.')
