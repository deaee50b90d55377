"""The messages of a ROS 2 bag as recorded, in order: .mcap, .db3 (rosbag2), or a bag's folder. Knows no ROS."""

import gzip
import sqlite3
import zlib
from collections.abc import Callable, Collection, Iterator
from contextlib import closing, contextmanager
from functools import reduce
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from tactile_node.errors import LogError
from tactile_node.logs.damage import Damage, DamageKind
from tactile_node.logs.replay_times import SECOND
from tactile_node.logs.series import BAG_SUFFIXES, Part, files_of, parts_of


def message_count(path: str | Path, types: Collection[str]) -> int | None:
    """Return the lines of a .log, or the messages of ``types`` in a bag of .mcap files; None where it is not known.

    What is wrong with a file is left to who reads it.
    """
    path = Path(path)
    try:
        if is_bag(path):
            return sum(_count_of_mcap(file, types) for file in files_of(path))
        name = Path(path.name.lower().removesuffix('.gz'))
        return sum(map(_lines, files_of(path))) if name.suffix == '.log' else None
    except (OSError, EOFError, zlib.error, LogError):
        return None


def _lines(path: Path) -> int:
    with gzip.open(path) if path.suffix == '.gz' else open(path, 'rb') as stream:
        return sum(chunk.count(b'\n') for chunk in iter(lambda: stream.read(1 << 20), b''))


def _count_of_mcap(path: Path, types: Collection[str]) -> int:
    """Raises EOFError for a file that has no counts: it was not ended, or is no .mcap."""
    with open_mcap(path) as file:
        if file.summary is None or file.summary.statistics is None:
            raise EOFError(f'{path} has no counts')
        counts = file.summary.statistics.channel_message_counts
        return sum(counts.get(channel.id, 0) for channel, schema in file.channels
                   if schema is not None and schema.name in types)


if TYPE_CHECKING:
    from tactile_node.logs.mcap_file import McapFile

MSG_ENCODING = 'ros2msg'  #: the encoding of definitions that are written as .msg files
OnDamage = Callable[[Damage], None]


class Recorded(NamedTuple):
    """One message of a bag."""

    topic: str
    type: str
    time: int  #: when it was recorded [ns]
    cdr: bytes
    definition: str = ''  #: the type and all that it contains, as .msg files; '': not in the bag


def is_bag(path: str | Path) -> bool:
    """Whether it is to be read as a bag: by suffix, or a folder."""
    return Path(path).suffix in BAG_SUFFIXES or Path(path).is_dir()


def records_of(path: str | Path, on_damage: OnDamage, since: int = 0, until: int | None = None) -> Iterator[Recorded]:
    """Read one message after the other of all files of the recording: those of ``since`` <= time < ``until`` [ns].

    What cannot be read goes to ``on_damage``, before the message that follows it. Raises LogError for no bag.
    """
    last: float | None = None
    damages: list[Damage] = []
    for found in _found(path, since):
        if isinstance(found, Damage):
            damages.append(found)
            continue
        if until is not None and found.time >= until:
            if found.time >= until + SECOND:  # messages are recorded in a wrong order by less
                break
            continue
        if damages:
            on_damage(_one(damages, last, found.time / SECOND))
            damages = []
        last = found.time / SECOND
        yield found
    if damages:
        on_damage(_one(damages, last, None))


def begin_of(path: str | Path) -> int:
    """Return when the first message was recorded [ns]; 0 where there is none. Raises LogError for no bag."""
    part = bag_parts(path)[0]
    if part.is_there and part.path.suffix == '.mcap':
        with open_mcap(part.path) as file:
            statistics = None if file.summary is None else file.summary.statistics
            if statistics is not None and statistics.message_count:
                return statistics.message_start_time
    first = next(records_of(path, lambda _: None), None)
    return 0 if first is None else first.time


def topics_of(path: str | Path) -> dict[str, str]:
    """Return the type of each topic in the bag, as far as it can be read; quick, unless the bag was not ended.

    Raises LogError for no bag.
    """
    found: dict[str, str] = {}
    for part in bag_parts(path):
        if part.is_there:
            found |= _topics_of_sqlite(part.path) if part.path.suffix == '.db3' else _topics_of_mcap(part.path)
    return found


def decompress(data: bytes) -> bytes:
    """``ros2 bag record --compression-mode message`` compresses each message alone."""
    if not data.startswith(b'\x28\xB5\x2F\xFD'):  # RFC 8878; CDR begins with 00
        return data
    return import_module('zstandard').ZstdDecompressor().decompressobj().decompress(data)


def library(name: str, path: str | Path):
    """Bags are an extra: without them their libraries are not needed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise LogError(str(path), expected='the libraries that bags need', got=str(error),
                       remedy="Install them: pip install 'tactile-skin[bag]'.") from error


def bag_parts(path: str | Path) -> tuple[Part, ...]:
    """Return the .mcap and .db3 files of a bag, in the order in which they were recorded. Raises LogError for none."""
    path = Path(path)
    if not path.exists():
        raise LogError(str(path), expected='a bag', got='no such file', remedy='Check the path.')
    parts = parts_of(path)
    if not any(part.is_there for part in parts):
        raise LogError(str(path), expected='a bag: .mcap or .db3 files', got='a folder without them',
                       remedy='Decompress a compressed bag first (ros2 bag convert).')
    return parts


def _found(path: str | Path, since: int) -> Iterator[Recorded | Damage]:
    for part in bag_parts(path):
        if not part.is_there:
            yield Damage(DamageKind.MISSING_FILE, part.path.name)
        else:
            yield from (_of_sqlite if part.path.suffix == '.db3' else _of_mcap)(part.path, since)


def _one(damages: list[Damage], begin: float | None, end: float | None) -> Damage:
    """Join the damages between two messages into one."""
    return reduce(Damage.joined, damages)._replace(begin=begin, end=end)


def _of_mcap(path: Path, since: int) -> Iterator[Recorded | Damage]:
    with open_mcap(path) as file:
        for found in file.read(since):
            if isinstance(found, Damage):
                yield found
            else:
                schema = found.schema
                yield Recorded(found.channel.topic, '' if schema is None else schema.name, found.time, found.data,
                               '' if schema is None else _definition(schema))


@contextmanager
def open_mcap(path: Path) -> Iterator['McapFile']:
    module = library('tactile_node.logs.mcap_file', path)
    with path.open('rb') as file:
        yield module.McapFile(file.fileno(), path.name)


def _definition(schema) -> str:
    return schema.data.decode('utf-8', 'replace') if schema.encoding == MSG_ENCODING else ''


def _topics_of_mcap(path: Path) -> dict[str, str]:
    with open_mcap(path) as file:
        if not file.channels:  # it was not ended
            for _ in file.read():
                pass
        return {channel.topic: '' if schema is None else schema.name for channel, schema in file.channels}


def _of_sqlite(path: Path, since: int) -> Iterator[Recorded | Damage]:
    try:
        with closing(open_sqlite(path)) as base:
            definitions = _definitions(base)
            for topic, kind, time, data in base.execute(
                    'SELECT topics.name, topics.type, messages.timestamp, messages.data FROM messages '
                    'JOIN topics ON messages.topic_id = topics.id WHERE messages.timestamp >= ? '
                    'ORDER BY messages.timestamp, messages.id', (since,)):
                yield Recorded(topic, kind, time, data, definitions.get(kind, ''))
    except sqlite3.Error as error:
        yield Damage(DamageKind.DATABASE, path.name, detail=str(error))


def _topics_of_sqlite(path: Path) -> dict[str, str]:
    try:
        with closing(open_sqlite(path)) as base:
            return dict(base.execute('SELECT name, type FROM topics'))
    except sqlite3.Error:
        return {}  # who reads the messages reports it


def open_sqlite(path: Path) -> sqlite3.Connection:
    """Open a database for reading, by one thread after the other: a log is opened, played and closed by several."""
    return sqlite3.connect(f'{path.resolve().as_uri()}?mode=ro', uri=True, check_same_thread=False)


def _definitions(base: sqlite3.Connection) -> dict[str, str]:
    """By type; bags before ROS 2 Iron have no such table."""
    try:
        return dict(base.execute('SELECT topic_type, encoded_message_definition FROM message_definitions '
                                 'WHERE encoding = ?', (MSG_ENCODING,)))
    except sqlite3.OperationalError:
        return {}
