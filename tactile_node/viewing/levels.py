"""Level and text of the driver's diagnostics, which a SkinStatus message contains, as text."""

from typing import Any, NamedTuple

LEVELS = ('NOT KNOWN', 'OK', 'WARN', 'ERROR', 'STALE')  #: names of the levels of SkinStatus and PadStatus
OK = LEVELS.index('OK')
OLD_STATUS_AGE = 3.0  #: age above which a status is marked as old [s]; the driver publishes a status every second


class Level(NamedTuple):
    """Level of the driver or of one pad, with the text that the driver also publishes on /diagnostics."""

    where: str
    text: str
    is_problem: bool


def levels_of(facts: Any) -> list[Level]:
    """Return the levels of the driver and its pads from a SkinStatus, or an empty list for other facts about a bus.

    The level of the driver is the worst one of the bus and all pads, but its text describes only the bus.
    """
    if not hasattr(facts, 'level'):
        return []
    found = [Level('driver', f'{LEVELS[facts.level]}, bus: {facts.message}', facts.level != OK)]
    return found + [Level(f'pad {pad.pad}', f'{LEVELS[pad.level]}: {pad.message}', pad.level != OK)
                    for pad in facts.pads]
