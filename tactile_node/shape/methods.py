"""Recognise a contact with one of the methods, without mistaking hidden taxels for empty ones.

`make_recogniser` provides the methods by name, for nodes and commands. Each method is applied by a `VisibilityGuard`,
which creates several readings of a contact with hidden taxels, in which these taxels are empty or pressed. If the
method reports the same shape for all readings, the hidden taxels do not matter. If the reported shapes differ, the
shape depends on the hidden taxels and is uncertain.

A contact passes these steps:

 1. A pad without a contact is NONE or not seen (`VisibilityGuard`).
 2. A contact that has no shape is UNKNOWN (`shapeless.is_shapeless`).
 3. If hidden taxels matter, the frame gets further readings (`completions`). Steps 4 to 11 apply to each reading.
 4. Pieces of a torn contact are joined (`patch.joined`).
 5. A second, low outline is added, which steps 6 to 9 treat like the first one (`support.low_outline`).
 6. The contact becomes a patch with its geometry (`patch.make_patch`, `invariants.describe_all`).
 7. The networks and their calibrations give the probabilities (`recogniser.ShapeRecogniser.answers`).
 8. A contact that is not convex is UNKNOWN (`support.is_convex`); taught shapes and the adaptation to a skin follow
    (`taught.join`, `adaptation`).
 9. The confidence is limited by the fit to the named figure (`support.as_far_as_it_fits`, `as_far_as_it_is_filled`)
    and by the edges that cut the contact (`as_far_as_no_edge_shapes_it`).
10. The confidence is limited by the answer for the low outline (`support.as_far_as_it_holds`).
11. If a contact of one piece has no sure name, steps 5 to 10 are repeated within the outline at which the readings fall
    steepest (`steepest_outline`).
12. The answers for all readings are averaged, an UNKNOWN contact gets its reason (`why_unfamiliar`), and a contact with
    too few taxels loses confidence (`support.as_far_as_supported`).

`fusion.py` then fuses the frames.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED, grown
from tactile_node.contact.pattern import ContactPattern, in_line, number_contacts
from tactile_node.contact.visibility import Visibility, visibility_of
from tactile_node.errors import ConfigurationError
from tactile_node.package_files import config_path
from tactile_node.shape.patch import joined
from tactile_node.shape.recogniser import ShapeRecogniser
from tactile_node.shape.recognition import (
    DEFAULT_METHOD,
    LEARNED,
    METHOD_FILES,
    VOLF,
    Recognition,
    ShapeClass,
    UnknownReason,
)
from tactile_node.shape.shapeless import is_cut, is_shapeless
from tactile_node.shape.support import UNSUPPORTED, as_far_as_supported, has_sure_name
from tactile_node.shape.volf import VolfClassifier
from tactile_node.taxel_frame import read_only

#: Weights of the original frame and of its three completions. A single completion with a different shape keeps the
#: confidence below 0.9.
READING_WEIGHTS = (1 / 2, 1 / 6, 1 / 6, 1 / 6)
#: If less than this share of the ring is hidden, FEW_WEIGHTS apply. The network was trained with smaller shares.
FEW_HIDDEN = 0.25
#: Weights if less than FEW_HIDDEN of the ring is hidden. Two completions with a different shape keep the confidence
#: below 0.9, but a single one does not. The weights were chosen on validation contacts.
FEW_WEIGHTS = (0.79, 0.07, 0.07, 0.07)


class RecognitionMethod(Protocol):
    """Interface of a recognition method. ``classes`` lists all classes that the method can report, in order."""

    classes: tuple[ShapeClass, ...]

    def recognise_all(self, patterns: Sequence[ContactPattern]) -> list[Recognition]:
        """Return the recognition of each of ``patterns``."""
        ...


class VisibilityGuard:
    """Applies a recognition method without mistaking hidden taxels for empty ones.

    - The guard reports NONE only if the pad is seen. If the pad is not seen, the guard reports UNKNOWN with the reason
      NOT_SEEN, or COVERS_PAD if an object covers the pad. A contact with few visible taxels that may continue in hidden
      taxels is also reported as NOT_SEEN.
    - If hidden taxels may change the shape, the guard reports the weighted mean of the method's results for all
      readings of the hidden taxels.
    - A contact is UNKNOWN if it may consist of specks or lines formed by chance. The reason is NOT_SEEN if hidden
      taxels matter.
    - For every other UNKNOWN contact, `why_unfamiliar` determines the reason.
    - If the method is adapted to a skin without touches of unknown objects, a name is sure only if it is also sure
      without the adaptation.

    Parameters
    ----------
    method : RecognitionMethod
        The method to apply.
    """

    def __init__(self, method: RecognitionMethod):
        self._method = method
        self._unadapted: RecognitionMethod | None = getattr(method, 'unadapted', None)
        self.classes = method.classes

    def recognise(self, pattern: ContactPattern, visibility: Visibility | None = None) -> Recognition:
        """Return the recognition of a contact, with a probability for each of ``classes``.

        Parameters
        ----------
        pattern : ContactPattern
            Pattern of the frame.
        visibility : Visibility or None
            Visibility of the pattern, or None to compute it from the pattern.
        """
        visibility = visibility or visibility_of(pattern)
        found = self._supported(self._method, pattern, visibility)
        if self._unadapted is not None and has_sure_name(found):
            before = self._supported(self._unadapted, pattern, visibility)
            if before.shape != found.shape or not has_sure_name(before):
                found = found.no_surer_than(UNSUPPORTED, UnknownReason.UNFAMILIAR)
        return found.over(self.classes)

    def _supported(self, method: RecognitionMethod, pattern: ContactPattern, visibility: Visibility) -> Recognition:
        found = self._recognise(method, pattern, visibility)
        if found.reason is UnknownReason.UNFAMILIAR:
            found = found._replace(reason=why_unfamiliar(pattern))
        return as_far_as_supported(found, pattern)

    def _recognise(self, method: RecognitionMethod, pattern: ContactPattern, visibility: Visibility) -> Recognition:
        if not pattern.contacts and not visibility.pad_seen:
            return Recognition.unknown(UnknownReason.COVERS_PAD if pattern.is_covered else UnknownReason.NOT_SEEN)
        if is_shapeless(pattern):
            return Recognition.unknown(UnknownReason.NOT_SEEN if hidden_taxels_matter(pattern, visibility)
                                       else UnknownReason.UNFAMILIAR)
        if not hidden_taxels_matter(pattern, visibility):
            return method.recognise_all([pattern])[0]
        readings, which = _distinct([pattern, *completions(pattern)])
        found = method.recognise_all(readings)
        if found[0].reason is UnknownReason.TOO_SMALL:
            return Recognition.unknown(UnknownReason.NOT_SEEN)
        is_little = visibility.hidden_in_ring < FEW_HIDDEN * visibility.ring
        return Recognition.mean_of(FEW_WEIGHTS if is_little else READING_WEIGHTS, [found[k] for k in which])


METHODS: dict[str, Callable[[Path], RecognitionMethod]] = {LEARNED: ShapeRecogniser.from_file,
                                                           VOLF: VolfClassifier.from_file}


def make_recogniser(method: str = DEFAULT_METHOD, file: str = '') -> VisibilityGuard:
    """Return the recogniser for a method.

    Parameters
    ----------
    method : str
        Name of the method, one of METHODS.
    file : str
        Path of the file with weights or curves, or '' for the method's own file in config/.

    Raises
    ------
    ConfigurationError
        Raised if the method does not exist or the file cannot be used.
    """
    if method not in METHODS:
        raise ConfigurationError('recognition method', expected='one of ' + ', '.join(METHODS), got=repr(method),
                                 remedy=f'Use {DEFAULT_METHOD!r} unless you want the paper as published.')
    return VisibilityGuard(METHODS[method](config_path(file or METHOD_FILES[method])))


#: Up to this share of the ring around a contact, isolated hidden taxels are treated as dead taxels, which change
#: little.
SCATTERED_SHARE = 0.1


def hidden_taxels_matter(pattern: ContactPattern, visibility: Visibility) -> bool:
    """Return True if hidden taxels may change the shape of the contact.

    Hidden taxels matter if connected taxels are hidden within the contact or its ring, or if more than SCATTERED_SHARE
    of the ring is hidden. A few scattered hidden taxels do not matter, because the recogniser was trained with such
    taxels.
    """
    if not visibility.hidden_in_ring and not visibility.hidden_in_contact:
        return False
    if visibility.hidden_in_ring > SCATTERED_SHARE * visibility.ring:
        return True
    if visibility.largest_hidden == 1:
        return False
    labels, _ = ndimage.label(pattern.hidden, EIGHT_CONNECTED)
    sizes = np.bincount(labels.reshape(-1))
    return bool((sizes[labels[grown(pattern.mask) & pattern.hidden]] > 1).any())


def completions(pattern: ContactPattern) -> tuple[ContactPattern, ContactPattern, ContactPattern]:
    """Return three readings of a contact with hidden taxels.

    In the first reading, the hidden taxels are empty. In the second reading, the hidden taxels next to the contact are
    pressed. In the third reading, the contact continues straight on along rows and columns as far as taxels are hidden.
    A hidden taxel that is read as pressed gets the median value of the contact.
    """
    nowhere = np.zeros_like(pattern.hidden)
    beside = grown(pattern.mask) & pattern.hidden
    continued = _continued(pattern)
    pressed_beside = _completed(pattern, beside)
    as_beside = np.array_equal(continued, beside)
    return _completed(pattern, nowhere), pressed_beside, pressed_beside if as_beside else _completed(pattern, continued)


def _distinct(patterns: Sequence[ContactPattern]) -> tuple[list[ContactPattern], list[int]]:
    """Remove repeated objects from a list of patterns.

    Parameters
    ----------
    patterns : sequence of ContactPattern
        Patterns, some of which may be the same object.

    Returns
    -------
    kept : list of ContactPattern
        Each pattern object once, in order of first appearance.
    which : list of int
        Index in ``kept`` for each of ``patterns``.
    """
    indices: dict[int, int] = {}
    which = [indices.setdefault(id(pattern), len(indices)) for pattern in patterns]
    return [patterns[which.index(k)] for k in range(len(indices))], which


def _completed(pattern: ContactPattern, pressed: np.ndarray) -> ContactPattern:
    """Return ``pattern`` with the hidden taxels read as pressed or empty.

    The largest piece becomes the contact.
    """
    seen = pattern.mask & ~pattern.hidden
    level = np.median(pattern.values[seen])
    values = np.where(pattern.hidden, level * pressed, pattern.values)
    labels, pieces = number_contacts(seen | pressed, np.zeros_like(seen))
    completed = ContactPattern.of(read_only(labels == 1), read_only(values))
    return completed._replace(contacts=pattern.contacts + pieces - 1)


def _continued(pattern: ContactPattern) -> np.ndarray:
    """Return the hidden taxels that the contact covers if it continues along rows and columns, without thin spikes."""
    reached = pattern.mask.copy()
    for direction in in_line(pattern.mask & ~pattern.hidden, pattern.hidden):
        reached |= direction
    wide = ndimage.binary_opening(reached, np.ones((2, 2)))  # a thin spike contains no square of 2x2 taxels
    return (wide | pattern.mask) & pattern.hidden


COVERED_SHARE = 0.6  #: If a contact covers more than this share of the visible taxels, its outline is not visible.
HOLLOW_TAXELS = 3    #: Smallest number of taxels in a hole. Uneven gains can cause smaller holes.


def why_unfamiliar(pattern: ContactPattern) -> UnknownReason:
    """Return the most obvious reason why a contact has none of the shapes.

    >>> why_unfamiliar(ContactPattern.of(np.eye(4) < 1, np.eye(4)))
    <UnknownReason.COVERS_PAD: 8>
    """
    contact = joined(pattern)
    taxels = np.count_nonzero(contact)
    seen = ~(pattern.hidden | pattern.unmapped)
    if taxels > COVERED_SHARE * np.count_nonzero(seen):
        return UnknownReason.COVERS_PAD
    if ndimage.label(contact, EIGHT_CONNECTED)[1] > 1:
        return UnknownReason.SEVERAL_PARTS
    if np.count_nonzero(ndimage.binary_fill_holes(contact) & ~contact & seen) >= HOLLOW_TAXELS:
        return UnknownReason.HOLLOW
    if is_cut(contact):
        return UnknownReason.CUT_BY_EDGE
    return UnknownReason.UNFAMILIAR
