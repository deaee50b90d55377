"""The groups of features, by name; apart from the features, so that a command line knows them at once."""

from enum import Flag, auto


class Group(Flag):
    """Which features to compute besides N, P05, P09; eigenvalues cost most."""

    NONE = 0
    INFORMATION5 = auto()
    INFORMATION9 = auto()
    GRAVITY5 = auto()
    GRAVITY9 = auto()
    EIGENVALUES = auto()
    BORDER = auto()  #: the groups above also for the reduced matrices
    ROTATED = auto()  #: min, max and dif over the rotations of everything computed
    INFORMATION = INFORMATION5 | INFORMATION9
    GRAVITY = GRAVITY5 | GRAVITY9
    CLASSIFIER = INFORMATION5 | GRAVITY9 | ROTATED  #: what the paper's planes need
    ALL = INFORMATION | GRAVITY | EIGENVALUES | BORDER | ROTATED
