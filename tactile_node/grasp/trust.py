"""Decide for planners in Python whether to act on a grasp, with the same rules as include/tactile_skin/trust.hpp.

Both implementations are tested with the cases in test/trust_cases.yaml.
"""

import math
from enum import Enum
from typing import Any

MAX_AGE = 0.3      #: Largest age of an acquisition [s].
MAX_SILENCE = 0.1  #: Largest time since the latest grasp arrived [s].


class Doubt(Enum):
    """Reason why a grasp must not be acted on. If several reasons apply, the first reason in this order is reported."""

    NONE = 'none'            #: the grasp may be acted on
    SILENT = 'silent'        #: no grasp has arrived for too long, perhaps because the publisher has stopped
    OLD = 'old'              #: the acquisition is too old, or its age is unknown
    NOT_KNOWN = 'not_known'  #: a side has no result yet
    UNSEEN = 'unseen'        #: a side is unseen and must not be treated as empty
    NO_CONTACT = 'no_contact'
    ONE_SIDED = 'one_sided'
    NOT_FRESH = 'not_fresh'
    BOUND = 'bound'  #: a contact may extend beyond the seen area, so that its true centre may differ
    NOT_STABLE = 'not_stable'
    NO_CENTRE = 'no_centre'  #: the centre or the offset is NaN


def doubt(grasp: Any, silence: float, max_age: float = MAX_AGE, max_silence: float = MAX_SILENCE) -> Doubt:
    """Return the reason why a grasp must not be acted on, or Doubt.NONE if it may be acted on.

    Parameters
    ----------
    grasp : Grasp
        The latest grasp message, or an object with the same fields.
    silence : float
        Time since the grasp arrived [s].
    max_age : float
        Largest age of the acquisition [s].
    max_silence : float
        Largest time since the grasp arrived [s].

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> doubt(SimpleNamespace(), silence=0.2)
    <Doubt.SILENT: 'silent'>
    """
    if not 0 <= silence <= max_silence:
        return Doubt.SILENT
    age = grasp.age.sec + grasp.age.nanosec * 1e-9  # an unknown age is at least 2^31 - 1 s
    if not (age >= 0 and age + silence <= max_age):
        return Doubt.OLD
    short_of = {grasp.UNSEEN: Doubt.UNSEEN, grasp.NO_CONTACT: Doubt.NO_CONTACT, grasp.ONE_SIDED: Doubt.ONE_SIDED}
    if grasp.contact != grasp.TWO_SIDED:
        return short_of.get(grasp.contact, Doubt.NOT_KNOWN)
    if not grasp.fresh:
        return Doubt.NOT_FRESH
    if grasp.line_is_bound:
        return Doubt.BOUND
    if not grasp.stable:
        return Doubt.NOT_STABLE
    return Doubt.NONE if all(map(math.isfinite, (*grasp.centre, grasp.offset))) else Doubt.NO_CENTRE
