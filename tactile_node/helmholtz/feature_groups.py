"""The groups of features by name, in a module of their own so that a command line loads quickly."""

from enum import Flag, auto


class Group(Flag):
    """Features to compute in addition to N, P05 and P09; eigenvalues take the most time."""

    NONE = 0
    INFORMATION5 = auto()
    INFORMATION9 = auto()
    GRAVITY5 = auto()
    GRAVITY9 = auto()
    EIGENVALUES = auto()
    BORDER = auto()   #: the other groups also for the reduced matrices
    ROTATED = auto()  #: minimum, maximum and difference over the rotations for all computed features
    INFORMATION = INFORMATION5 | INFORMATION9
    GRAVITY = GRAVITY5 | GRAVITY9
    CLASSIFIER = INFORMATION5 | GRAVITY9 | ROTATED  #: the features for the planes of the paper
    ALL = INFORMATION | GRAVITY | EIGENVALUES | BORDER | ROTATED
