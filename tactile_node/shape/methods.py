"""The recognition methods by name, for nodes and commands."""

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

#: Weights of the frame as it is and of its three completions. A single completion with another answer keeps the
#: confidence below 0.9.
READING_WEIGHTS = (1 / 2, 1 / 6, 1 / 6, 1 / 6)
#: Share of the ring. The network was trained with fewer hidden taxels than this.
FEW_HIDDEN = 0.25
#: Weights if fewer taxels than FEW_HIDDEN are hidden. Two completions with another answer keep the confidence below
#: 0.9, a single one does not. Chosen on validation contacts.
FEW_WEIGHTS = (0.79, 0.07, 0.07, 0.07)


class RecognitionMethod(Protocol):
    """Interface of a recognition method; ``classes`` lists all its possible answers in order."""

    classes: tuple[ShapeClass, ...]

    def recognise_all(self, patterns: Sequence[ContactPattern]) -> list[Recognition]:
        """Return the recognition of each of ``patterns``."""
        ...


class VisibilityGuard:
    """Applies a recognition method without taking hidden taxels for empty ones.

    - The guard answers NONE only if the pad is seen. Otherwise it answers UNKNOWN with the reason NOT_SEEN. It gives
      the same answer for a contact with few visible taxels that may continue in hidden taxels.
    - If hidden taxels may change the answer, the guard reports the weighted mean of the method's answers to all
      readings of the hidden taxels.
    - A contact that specks or lines may form by chance is UNKNOWN. The reason is NOT_SEEN if hidden taxels matter.
    - Every other UNKNOWN gets its reason from `why_unfamiliar`.

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
            Visibility of the pattern if the caller knows it; None to compute it.
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
        Path of the file with weights or curves; '' for the method's own file in config/.

    Raises
    ------
    ConfigurationError
        If the method does not exist or the file cannot be used.
    """
    if method not in METHODS:
        raise ConfigurationError('recognition method', expected='one of ' + ', '.join(METHODS), got=repr(method),
                                 remedy=f'Use {DEFAULT_METHOD!r} unless you want the paper as published.')
    return VisibilityGuard(METHODS[method](config_path(file or METHOD_FILES[method])))
