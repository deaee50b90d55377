"""The ways to recognise a shape, chosen by name: what nodes and commands call."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import numpy as np

from tactile_node.contact.pattern import ContactPattern
from tactile_node.errors import ConfigurationError
from tactile_node.helmholtz.features import Features, Group, compute_features
from tactile_node.package_files import config_path
from tactile_node.shape.recogniser import ShapeRecogniser
from tactile_node.shape.recognition import Recognition, Shape
from tactile_node.shape.volf import GROUPS, VolfClassifier

LEARNED, VOLF = 'learned', 'volf'
DEFAULT = LEARNED
SEEN = 0.5  #: share of a pad's taxels that must have valid values before it is reported untouched
FILES = {LEARNED: 'recogniser.npz', VOLF: 'volf_curves.yaml'}  #: what each reads by default, in config/


class RecognitionMethod(Protocol):
    """What every method offers; ``groups`` are the features it reads, Group.NONE where it reads none."""

    groups: Group

    def recognise(self, pattern: ContactPattern, features: Features | None = None) -> Recognition:
        """Recognise ``pattern``; ``features`` of its mask spare their computation where they are known."""
        ...


class Learned:
    """tactile_node.shape.recogniser behind the common interface."""

    groups = Group.NONE

    def __init__(self, path: str | Path):
        self._recogniser = ShapeRecogniser.from_file(path)

    def recognise(self, pattern: ContactPattern, features: Features | None = None) -> Recognition:
        return self._recogniser.recognise(pattern)


class Volf:
    """The paper's three planes behind the common interface."""

    groups = GROUPS

    def __init__(self, path: str | Path):
        self._classifier = VolfClassifier.from_file(path)

    def recognise(self, pattern: ContactPattern, features: Features | None = None) -> Recognition:
        return self._classifier.recognise(compute_features(pattern.mask, GROUPS) if features is None else features)


class VisibilityGuard:
    """A method that distinguishes an empty pad from one that it cannot see: without valid values it answers UNKNOWN."""

    def __init__(self, method: RecognitionMethod):
        self._method = method
        self.groups = method.groups

    def recognise(self, pattern: ContactPattern, features: Features | None = None) -> Recognition:
        if not pattern.contacts and np.isfinite(pattern.values).mean() < SEEN:
            return Recognition.certain(Shape.UNKNOWN)
        return self._method.recognise(pattern, features)


METHODS: dict[str, Callable[[Path], RecognitionMethod]] = {LEARNED: Learned, VOLF: Volf}


def make_recogniser(method: str = DEFAULT, file: str = '') -> RecognitionMethod:
    """Return the recogniser called ``method``; ``file``: its weights or curves, '' for those of config/.

    Raises ConfigurationError for a name that is none, or a file that cannot be used.
    """
    if method not in METHODS:
        raise ConfigurationError('recognition method', expected='one of ' + ', '.join(METHODS), got=repr(method),
                                 remedy=f'Use {DEFAULT!r} unless you want the paper as published.')
    return VisibilityGuard(METHODS[method](config_path(file or FILES[method])))
