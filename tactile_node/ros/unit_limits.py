"""From which reading on a taxel is pressed, by the unit of the taxels, unless a parameter gives the limit."""

from tactile_node.errors import ConfigurationError

PRESSED_BY_UNIT = {'Pa': 30e3, 'N': 0.1, '1': 0.5}
#: At a tare a taxel counts as pressed from here on: less than a contact.
TARE_LIMIT_BY_UNIT = {'Pa': 10e3, 'N': 0.03}
ON_OFF_UNIT = '1'
ON_OFF_LIMIT = 0.5


def pressed_thresholds(press_threshold: float, release_ratio: float, unit: str) -> tuple[float, float]:
    """Return the press and release thresholds [``unit``]; ``press_threshold`` 0: by the unit.

    Raises ConfigurationError for an unknown unit.
    """
    press = press_threshold or PRESSED_BY_UNIT.get(unit)
    if press is None:
        raise ConfigurationError('parameter press_threshold', expected=f'a threshold for taxels in {unit!r}', got='0',
                                 remedy=f'Only {", ".join(PRESSED_BY_UNIT)} have a default; set one.')
    return press, press * release_ratio


def tare_limit(given: float, unit: str) -> float:
    """Return ``given``, or the limit for ``unit`` where it is 0. Raises ConfigurationError where there is none."""
    limit = None if unit == ON_OFF_UNIT else given or TARE_LIMIT_BY_UNIT.get(unit)
    if limit is None:
        raise ConfigurationError('tare', expected='taxels in ' + ' or '.join(TARE_LIMIT_BY_UNIT), got=repr(unit),
                                 remedy='On/off taxels have no zero to set.')
    return limit


def rest_limit(given: float, unit: str) -> float:
    """As `tare_limit`, for on/off taxels too: below it a taxel is not pressed."""
    return ON_OFF_LIMIT if unit == ON_OFF_UNIT else tare_limit(given, unit)
