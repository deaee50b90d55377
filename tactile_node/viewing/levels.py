"""Level and text of the driver's diagnostics, which a SkinStatus message contains, as text."""

from typing import Any, NamedTuple

LEVELS = ('NOT KNOWN', 'OK', 'WARN', 'ERROR', 'STALE')  #: names of the levels of SkinStatus and PadStatus
OK = LEVELS.index('OK')
OLD_STATUS_AGE = 3.0  #: age above which a status is marked as old [s]; the driver publishes a status every second


class Level(NamedTuple):
    """Level of the bus or of one pad, with the text that the driver also publishes on /diagnostics."""

    where: str
    text: str
    is_problem: bool


def levels_of(facts: Any) -> list[Level]:
    """Return the levels of the bus and its pads from a SkinStatus, or an empty list for other facts about a bus."""
    if not hasattr(facts, 'level'):
        return []
    found = [('bus', facts), *((f'pad {pad.pad}', pad) for pad in facts.pads)]
    return [Level(f'driver, {where}', f'{LEVELS[each.level]}: {each.message}', each.level != OK)
            for where, each in found]
