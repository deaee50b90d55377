"""What of a recording cannot be read: why, how much of it, and the time in which it was recorded."""

from collections.abc import Sequence
from datetime import datetime, timezone
from typing import NamedTuple

from tactile_node.code_names import PhrasedCode


class DamageKind(PhrasedCode):
    """Why something of a bag or a series of files is not given."""

    CHUNK = 1, 'a damaged chunk'  #: its content does not fit its checksum, or cannot be decompress
    RECORDS = 2, 'damaged records'  #: bytes between two chunks are no records
    CUT_SHORT = 3, 'cut short: it was not ended'  #: a killed recording, a full disk, a part of a download
    MISSING_FILE = 4, 'no such file, of a series'
    UNKNOWN_CHANNEL = 5, 'messages of an unknown channel'  #: whose record is lost
    UNDECODABLE = 6, 'a message that does not fit its definition'
    DATABASE = 7, 'cut short or damaged'  #: what follows in a .db3
    INCONSISTENT = 8, 'a TaxelArray whose fields do not fit together'


class Damage(NamedTuple):
    """One place of a recording; neighbouring ones are one."""

    kind: DamageKind
    file: str  #: its name
    chunks: int | None = None  #: MCAP chunks that are lost; None: not known
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
    return f'{damage.file}: {damage.kind.phrase}' + (f' ({"; ".join(details)})' if details else '')


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
