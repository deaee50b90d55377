"""How a skin sends TPDOs without SYNC: the key ``event_driven`` of its layout (CiA 301, 7.2.2)."""

from dataclasses import dataclass

from tactile_node.cia301.pdo import (
    EVENT_TIMER,
    EVENT_TIMER_UNIT,
    INHIBIT_TIME,
    INHIBIT_UNIT,
    MANUFACTURER_EVENT,
    MAX_TIME,
    PROFILE_EVENT,
)
from tactile_node.yaml_section import Section

AGED_AFTER = 3  #: event timers: two transmissions in a row may be lost
SWEEP_SHARE = 0.45  #: of the period; twice that leaves a tenth for the device's timer and our stamps


@dataclass(frozen=True)
class EventDriven:
    """How a device sends without SYNC (CiA 301: transmission types 254 and 255). Times in seconds."""

    transmission_type: int
    event_timer: float  #: the most between two transmissions of a TPDO; 0: off
    inhibit_time: float  #: the least between two transmissions of a TPDO
    is_sweeps: bool  #: sends all TPDOs of a scan together, in the layout's order; else each TPDO at its own time
    period: float  #: the least between the beginnings of two sweeps; without sweeps the event timer
    max_age: float  #: without sweeps, how old the values of a TPDO may become

    @property
    def times(self) -> dict[int, int]:
        """The times as a TPDO's communication record holds them, by sub-index."""
        return {INHIBIT_TIME: round(self.inhibit_time / INHIBIT_UNIT),
                EVENT_TIMER: round(self.event_timer / EVENT_TIMER_UNIT)}

    @property
    def sweep_time(self) -> float:
        """Within which all TPDOs of a sweep come."""
        return SWEEP_SHARE * self.period

    @property
    def longest_pause(self) -> float:
        """Without any TPDO, while the device works."""
        return max(self.event_timer, self.period)


def read_event_driven(top: Section) -> EventDriven | None:
    """Read the key ``event_driven`` of a skin layout; None where it has none. Raises ConfigurationError."""
    if top.take('event_driven', None) is None:
        return None
    section = top.section('event_driven')
    kind = section.integer('transmission_type', MANUFACTURER_EVENT, PROFILE_EVENT)
    timer = _time(section, 'event_timer', EVENT_TIMER_UNIT)
    inhibit = _time(section, 'inhibit_time', INHIBIT_UNIT, 0)
    is_sweeps = section.choice('frames', ('sweeps', 'snapshots')) == 'sweeps'
    period, max_age = timer, 0.0
    if is_sweeps:
        period = section.number('period', *([timer] if timer else []), positive=True)
    elif not timer:
        section.refuse('event_timer', expected='one > 0, as TPDOs come each at its own time', got='0',
                       remedy='Without it a TPDO that is lost for ever looks like one whose taxels do not change.')
    else:
        max_age = section.number('max_age', AGED_AFTER * timer, positive=True)
    section.done()
    return EventDriven(kind, timer, inhibit, is_sweeps, period, max_age)


def _time(section: Section, key: str, unit: float, *default: float) -> float:
    """Read a time [s] that the device holds as a number of ``unit`` [s] in 16 bits."""
    value = section.number(key, *default)
    if not 0 <= value <= MAX_TIME * unit or abs(value - round(value / unit) * unit) > unit / 1000:
        section.refuse(key, expected=f'0..{MAX_TIME * unit:g} s in steps of {unit:g} s', got=f'{value:g}',
                       remedy='Write it in seconds, 20 ms as 0.02.')
    return value
