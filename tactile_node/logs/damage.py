"""Describe the unreadable parts of a recording: the reason, the size and the time of recording."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import datetime, timezone
from typing import NamedTuple, TypeVar

from tactile_node.code_names import PhrasedCode


class DamageKind(PhrasedCode):
    """Reasons why a part of a bag or a series of files cannot be read."""

    CHUNK = 1, 'a damaged chunk'  #: the checksum of the chunk is wrong, or the chunk cannot be decompressed
    RECORDS = 2, 'damaged records'  #: the bytes between two chunks are not records
    CUT_SHORT = 3, 'cut short before its end'  #: caused by a killed recorder, a full disk or an incomplete download
    MISSING_FILE = 4, 'a missing file of a series'
    UNKNOWN_CHANNEL = 5, 'messages of an unknown channel'  #: the record with the description of the channel is lost
    UNDECODABLE = 6, 'a message that does not fit its definition'
    DATABASE = 7, 'cut short or damaged'  #: the rest of a .db3 cannot be read
    INCONSISTENT = 8, 'a TaxelArray with inconsistent fields'


class Damage(NamedTuple):
    """One damaged place in a recording. Adjacent damaged places are merged."""

    kind: DamageKind
    file: str  #: name of the file
    chunks: int | None = None  #: number of lost MCAP chunks, or None if unknown
    size: int = 0  #: number of lost bytes
    begin: float | None = None  #: recording time of the message before the damage [s, Unix epoch], or None
    end: float | None = None    #: recording time of the message after the damage [s, Unix epoch], or None
    detail: str = ''  #: error message of the library that read the part

    @property
    def seconds(self) -> float | None:
        """Maximum duration of the lost part [s], or None if it is at the start or end of the recording."""
        return None if self.begin is None or self.end is None else max(self.end - self.begin, 0.0)

    def joined(self, after: 'Damage') -> 'Damage':
        """Merge this damaged place with the following place ``after``, and keep the kind of this place."""
        chunks = None if self.chunks is None or after.chunks is None else self.chunks + after.chunks
        return self._replace(chunks=chunks, size=self.size + after.size)


OnDamage = Callable[[Damage], None]
T = TypeVar('T')


def placed(found: Iterable[T | Damage], time_of: Callable[[T], float], on_damage: OnDamage) -> Iterator[T]:
    """Yield the readable parts of a recording, and report each damaged place with the times of its neighbours.

    Adjacent damaged places are reported as one, before the part that follows them is yielded.

    Parameters
    ----------
    found
        Readable parts and damaged places, in the order of recording.
    time_of
        Function that returns the time of a readable part [s, Unix epoch].
    on_damage
        Called with each damaged place.

    Examples
    --------
    >>> lost = Damage(DamageKind.CHUNK, 'x.mcap', 1, 4096)
    >>> list(placed([10.0, lost, lost, 10.5], float, lambda damage: print(damage_text(damage))))
    x.mcap: a damaged chunk (2 chunks, 8192 bytes, 0.500 s from 1970-01-01 00:00:10.000 UTC on)
    [10.0, 10.5]
    """
    last: float | None = None
    damage: Damage | None = None
    for each in found:
        if isinstance(each, Damage):
            damage = each if damage is None else damage.joined(each)
            continue
        time = time_of(each)
        if damage is not None:
            on_damage(damage._replace(begin=last, end=time))
            damage = None
        last = time
        yield each
    if damage is not None:
        on_damage(damage._replace(begin=last))


MOST_LINES = 20  #: maximum number of damaged places listed


def damage_text(damage: Damage) -> str:
    """Describe a damaged place in words that fit into a sentence.

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
    """Return one line for each of the first MOST_LINES damaged places, and one line that counts further places."""
    lines = [f'{damage_text(damage)}.' for damage in damages[:MOST_LINES]]
    return lines + ([f'... and {len(damages) - MOST_LINES} more.'] if len(damages) > MOST_LINES else [])


def _span(damage: Damage) -> str:
    if damage.begin is not None and damage.begin == damage.end:
        return f'at {utc(damage.begin)}'
    if damage.seconds is not None and damage.begin is not None:
        return f'{damage.seconds:.3f} s from {utc(damage.begin)} on'
    if damage.begin is not None:
        return f'from {utc(damage.begin)} on'
    return f'before {utc(damage.end)}' if damage.end is not None else ''


def utc(seconds: float) -> str:
    """Format a Unix time [s] with a resolution of 1 ms. A number outside the range of dates is formatted as seconds.

    >>> utc(0.5)
    '1970-01-01 00:00:00.500 UTC'
    """
    try:
        found = datetime.fromtimestamp(seconds, timezone.utc)
    except (OverflowError, ValueError, OSError):  # a bag may contain any 64-bit number
        return f'{seconds:.3f} s'
    return found.isoformat(' ', 'milliseconds').replace('+00:00', ' UTC')
