"""What a taxel may read at rest: above, something is on the pad."""

from tactile_node.errors import ConfigurationError

#: A taxel that reads so much is pressed when a tare is requested: less than a contact worth the name.
TARE_LIMIT_BY_UNIT = {'Pa': 10e3, 'N': 0.03}
ON_OFF_UNIT = '1'
ON_OFF_LIMIT = 0.5


def tare_limit(given: float, unit: str) -> float:
    """Return ``given``, or where it is 0 the limit for ``unit``. Raises ConfigurationError where there is none."""
    limit = None if unit == ON_OFF_UNIT else given or TARE_LIMIT_BY_UNIT.get(unit)
    if limit is None:
        raise ConfigurationError('tare', expected='taxels in ' + ' or '.join(TARE_LIMIT_BY_UNIT), got=repr(unit),
                                 remedy='On/off taxels have no zero to set.')
    return limit


def rest_limit(given: float, unit: str) -> float:
    """Return the same for on/off taxels too: below it a taxel is not pressed."""
    return ON_OFF_LIMIT if unit == ON_OFF_UNIT else tare_limit(given, unit)
