"""Provide the recognition methods by name, for nodes and commands."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.visibility import Visibility, visibility_of
from tactile_node.errors import ConfigurationError
from tactile_node.package_files import config_path
from tactile_node.shape.completion import completions, distinct, hidden_taxels_matter
from tactile_node.shape.reasons import why_unfamiliar
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
from tactile_node.shape.shapeless import is_shapeless
from tactile_node.shape.support import as_far_as_supported
from tactile_node.shape.volf import VolfClassifier

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

    Parameters
    ----------
    method : RecognitionMethod
        The method to apply.
    """

    def __init__(self, method: RecognitionMethod):
        self._method = method
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
        found = self._recognise(pattern, visibility or visibility_of(pattern))
        if found.reason is UnknownReason.UNFAMILIAR:
            found = found._replace(reason=why_unfamiliar(pattern))
        return as_far_as_supported(found, pattern).over(self.classes)

    def _recognise(self, pattern: ContactPattern, visibility: Visibility) -> Recognition:
        if not pattern.contacts and not visibility.pad_seen:
            return Recognition.unknown(UnknownReason.COVERS_PAD if pattern.is_covered else UnknownReason.NOT_SEEN)
        if is_shapeless(pattern):
            return Recognition.unknown(UnknownReason.NOT_SEEN if hidden_taxels_matter(pattern, visibility)
                                       else UnknownReason.UNFAMILIAR)
        if not hidden_taxels_matter(pattern, visibility):
            return self._method.recognise_all([pattern])[0]
        readings, which = distinct([pattern, *completions(pattern)])
        found = self._method.recognise_all(readings)
        if found[0].reason is UnknownReason.TOO_SMALL:
            return Recognition.unknown(UnknownReason.NOT_SEEN)
        is_little = visibility.hidden_in_ring < FEW_HIDDEN * visibility.ring
        return Recognition.of_alternatives(FEW_WEIGHTS if is_little else READING_WEIGHTS, [found[k] for k in which])


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
