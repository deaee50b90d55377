"""The ways to recognise a shape, chosen by name: what nodes and commands call."""

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

#: of the frame as it is, and of each of its completions: any of these that differs keeps the confidence below 0.9
READING_WEIGHTS = (1 / 2, 1 / 6, 1 / 6, 1 / 6)
#: Less than FEW_HIDDEN of the ring is hidden, as the network was trained with: two or three that differ keep it below
#: 0.9, one does not. Chosen on validation contacts.
FEW_HIDDEN, FEW_WEIGHTS = 0.25, (0.79, 0.07, 0.07, 0.07)


class RecognitionMethod(Protocol):
    """What every method offers; ``classes``: all that it can answer, in order."""

    classes: tuple[ShapeClass, ...]

    def recognise_all(self, patterns: Sequence[ContactPattern]) -> list[Recognition]:
        """Recognise each of ``patterns``."""
        ...


class VisibilityGuard:
    """A method that does not take what is hidden for what is not there.

    NONE needs a pad that is seen: otherwise it answers UNKNOWN, NOT_SEEN, as it does for the few visible taxels of a
    contact that may continue where taxels are hidden. Where hidden taxels may change the answer, it reports the mean
    of what the method answers to each way of reading them.

    A contact that specks or lines make by chance is UNKNOWN: NOT_SEEN where hidden taxels matter. The reason of any
    other UNKNOWN is that of `why_unfamiliar`.
    """

    def __init__(self, method: RecognitionMethod):
        self._method = method
        self.classes = method.classes

    def recognise(self, pattern: ContactPattern, visibility: Visibility | None = None) -> Recognition:
        """Recognise ``pattern``; its ``visibility``, where it is known, spares the computation of it.

        There is a probability of each of ``classes``, whatever the answer.
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
    """Return the recogniser called ``method``; ``file``: its weights or curves, '' for those of config/.

    Raises ConfigurationError for a name that is none, or a file that cannot be used.
    """
    if method not in METHODS:
        raise ConfigurationError('recognition method', expected='one of ' + ', '.join(METHODS), got=repr(method),
                                 remedy=f'Use {DEFAULT_METHOD!r} unless you want the paper as published.')
    return VisibilityGuard(METHODS[method](config_path(file or METHOD_FILES[method])))
