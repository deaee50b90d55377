"""What a taxel may read at rest: above, something is on the pad."""

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.press_levels import ON_OFF_UNIT, PRESS_BY_UNIT

#: A taxel that reads so much is pressed when a tare is requested: less than a contact worth the name.
TARE_LIMIT_BY_UNIT = {'Pa': 10e3, 'N': 0.03}


def tare_limit(given: float, unit: str) -> float:
    """Return ``given``, or where it is 0 the limit for ``unit``. Raises ConfigurationError where there is none."""
    limit = None if unit == ON_OFF_UNIT else given or TARE_LIMIT_BY_UNIT.get(unit)
    if limit is None:
        raise ConfigurationError('tare', expected='taxels in ' + ' or '.join(TARE_LIMIT_BY_UNIT), got=repr(unit),
                                 remedy='On/off taxels have no zero to set.')
    return limit


def rest_limit(given: float, unit: str) -> float:
    """Return the same for on/off taxels too: below it a taxel is not pressed."""
    return PRESS_BY_UNIT[ON_OFF_UNIT] if unit == ON_OFF_UNIT else tare_limit(given, unit)


def drift_limit(given: float, unit: str, gains: np.ndarray | None = None) -> float:
    """Return what the zero may be followed by: a ``given`` tare limit beyond the unit's own would hide a grasp.

    So would one that the largest of ``gains`` makes a contact of. Raises ConfigurationError where there is no zero.
    """
    largest = 1.0 if gains is None else max(1.0, float(gains.max()))
    return min(tare_limit(given, unit), tare_limit(0.0, unit)) / largest
