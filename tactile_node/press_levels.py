"""From which reading on a taxel is pressed, by the unit of its values: known to the tare as to the contact pattern."""

#: Absolute thresholds: a taxel is pressed from here on: 30 kPa, 0.1 N, on.
PRESS_BY_UNIT = {'Pa': 30e3, 'N': 0.1, '1': 0.5}
RELEASE_RATIO = 0.8  #: share of the press threshold
ON_OFF_UNIT = '1'
#: Below this no taxel is pressed, however quiet the skin is: drift between two tares may reach it.
LEAST_BY_UNIT = {'Pa': 2e3, 'N': 0.007}
