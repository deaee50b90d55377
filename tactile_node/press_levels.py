"""From which reading on a taxel is pressed, by the unit of its values: known to the tare as to the contact pattern."""

#: A taxel is pressed from here on: 30 kPa, 0.1 N, on.
PRESS_BY_UNIT = {'Pa': 30e3, 'N': 0.1, '1': 0.5}
RELEASE_RATIO = 0.8  #: of the press threshold
