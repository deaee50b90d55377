"""What of a recording cannot be read: why, how much of it, and the time in which it was recorded."""

from collections.abc import Sequence
from datetime import datetime, timezone
from enum import IntEnum, unique
from typing import NamedTuple


@unique
class DamageKind(IntEnum):
    """Why something of a bag or a series of files is not given. The codes are stable."""

    CHUNK = 1            #: the content of a chunk does not fit its checksum, or cannot be decompressed
    RECORDS = 2          #: bytes between two chunks are no records
    CUT_SHORT = 3        #: the file was not ended: a killed recording, a full disk, a part of a download
    MISSING_FILE = 4     #: of a series
    UNKNOWN_CHANNEL = 5  #: messages of a channel whose record is lost
    UNDECODABLE = 6      #: a message that does not fit its definition
    DATABASE = 7         #: what follows in a .db3


class Damage(NamedTuple):
    """One place of a recording; neighbouring ones are one."""

    kind: DamageKind
    file: str  #: its name
    chunks: int | None = None  #: of MCAP, that are lost; None: not known
    size: int = 0  #: [bytes]
    begin: float | None = None  #: when the message before it was recorded [s, Unix epoch]; None: there is none
    end: float | None = None    #: when the message after it was recorded
    detail: str = ''  #: what the library that reads it says

    @property
    def seconds(self) -> float | None:
        """Seconds of the recording that are lost at most; None where it is its begin or its end."""
        return None if self.begin is None or self.end is None else max(self.end - self.begin, 0.0)

    def joined(self, after: 'Damage') -> 'Damage':
        """Return both as one, of this one's kind."""
        chunks = None if self.chunks is None or after.chunks is None else self.chunks + after.chunks
        return self._replace(chunks=chunks, size=self.size + after.size)


MOST_LINES = 20
_TEXTS = {DamageKind.CHUNK: 'a damaged chunk', DamageKind.RECORDS: 'damaged records',
          DamageKind.CUT_SHORT: 'cut short: it was not ended', DamageKind.MISSING_FILE: 'no such file, of a series',
          DamageKind.UNKNOWN_CHANNEL: 'messages of an unknown channel',
          DamageKind.UNDECODABLE: 'a message that does not fit its definition',
          DamageKind.DATABASE: 'cut short or damaged'}


def damage_text(damage: Damage) -> str:
    """Return it as a part of a sentence.

    >>> damage_text(Damage(DamageKind.CHUNK, 'x.mcap', 1, 4096, 10.0, 10.5, 'crc'))
    'x.mcap: a damaged chunk (1 chunks, 4096 bytes, 0.500 s from 1970-01-01 00:00:10.000 UTC on; crc)'
    """
    facts = [] if damage.chunks is None else [f'{damage.chunks} chunks']
    facts += [f'{damage.size} bytes'] if damage.size else []
    facts += [_span(damage)] if _span(damage) else []
    details = [', '.join(facts)] if facts else []
    details += [damage.detail] if damage.detail else []
    return f'{damage.file}: {_TEXTS[damage.kind]}' + (f' ({"; ".join(details)})' if details else '')


def damage_lines(damages: Sequence[Damage]) -> list[str]:
    """Return a line for each of the first MOST_LINES, and one that says how many follow."""
    lines = [f'{damage_text(damage)}.' for damage in damages[:MOST_LINES]]
    return lines + ([f'... and {len(damages) - MOST_LINES} more.'] if len(damages) > MOST_LINES else [])


def _span(damage: Damage) -> str:
    if damage.seconds is not None and damage.begin is not None:
        return f'{damage.seconds:.3f} s from {utc(damage.begin)} on'
    if damage.begin is not None:
        return f'from {utc(damage.begin)} on'
    return f'before {utc(damage.end)}' if damage.end is not None else ''


def utc(seconds: float) -> str:
    """Return a Unix time [s] in words, to 1 ms; one that is no date as a number.

    >>> utc(0.5)
    '1970-01-01 00:00:00.500 UTC'
    """
    try:
        found = datetime.fromtimestamp(seconds, timezone.utc)
    except (OverflowError, ValueError, OSError):  # any number of 64 bits may stand in a bag
        return f'{seconds:.3f} s'
    return found.isoformat(' ', 'milliseconds').replace('+00:00', ' UTC')
