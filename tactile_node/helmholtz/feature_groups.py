"""Name the groups of features. The module is separate so that the command line loads quickly."""

from enum import Flag, auto


class Group(Flag):
    """Features to compute in addition to N, P05 and P09. The eigenvalues take the most time."""

    NONE = 0
    INFORMATION5 = auto()
    INFORMATION9 = auto()
    GRAVITY5 = auto()
    GRAVITY9 = auto()
    EIGENVALUES = auto()
    BORDER = auto()   #: also compute the other groups for the reduced matrices
    ROTATED = auto()  #: minimum, maximum and difference of all computed features over the rotations
    INFORMATION = INFORMATION5 | INFORMATION9
    GRAVITY = GRAVITY5 | GRAVITY9
    CLASSIFIER = INFORMATION5 | GRAVITY9 | ROTATED  #: features from which the planes of the paper compute the class
    ALL = INFORMATION | GRAVITY | EIGENVALUES | BORDER | ROTATED
