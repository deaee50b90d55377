"""Whether a grasp may be acted on now: the rules of include/tactile_skin/trust.hpp, for planners in Python.

Both are tested with the cases of test/trust_cases.yaml.
"""

import math
from enum import Enum
from typing import Any

MAX_AGE = 0.3      #: of an acquisition [s]
MAX_SILENCE = 0.1  #: since the latest grasp arrived [s]


class Doubt(Enum):
    """Why a grasp must not be acted on: the first that holds, in this order."""

    NONE = 'none'  #: it may
    SILENT = 'silent'  #: no grasp for too long: the publisher may have ended
    OLD = 'old'  #: its acquisition, or its age is not known
    NOT_KNOWN = 'not_known'  #: a side has no result yet
    UNSEEN = 'unseen'  #: never take it for empty
    NO_CONTACT = 'no_contact'
    ONE_SIDED = 'one_sided'
    NOT_FRESH = 'not_fresh'
    BOUND = 'bound'  #: a contact may reach beyond what is seen: its centre is another one
    NOT_STABLE = 'not_stable'
    NO_CENTRE = 'no_centre'  #: NaN


def doubt(grasp: Any, silence: float, max_age: float = MAX_AGE, max_silence: float = MAX_SILENCE) -> Doubt:
    """Return why ``grasp``, a Grasp or what has its fields, must not be acted on ``silence`` s after it arrived.

    >>> from types import SimpleNamespace
    >>> doubt(SimpleNamespace(), silence=0.2)
    <Doubt.SILENT: 'silent'>
    """
    if not 0 <= silence <= max_silence:
        return Doubt.SILENT
    age = grasp.age.sec + grasp.age.nanosec * 1e-9  # 2^31 - 1 s and more: not known
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
