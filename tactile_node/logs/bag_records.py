"""Read the raw messages of a ROS 2 bag in order without ROS: .mcap, .db3 (rosbag2) or a bag folder."""

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
    """Count the messages of a recording for a progress bar.

    Errors in the file are ignored during counting, because the message reader reports them.

    Parameters
    ----------
    path
        Path of a .log file, whose lines are counted, or of a bag of .mcap files.
    types
        Message types to count in a bag.

    Returns
    -------
    int or None
        Number of lines or messages, or None if counting would require reading the messages.
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
    """Return the number of messages according to the summary. Raises EOFError if the file has no summary."""
    with open_mcap(path) as file:
        if file.summary is None or file.summary.statistics is None:
            raise EOFError(f'{path} has no counts')
        counts = file.summary.statistics.channel_message_counts
        return sum(counts.get(channel.id, 0) for channel, schema in file.channels
                   if schema is not None and schema.name in types)


if TYPE_CHECKING:
    from tactile_node.logs.mcap_file import McapFile

MSG_ENCODING = 'ros2msg'  #: name of the encoding for message definitions written as in .msg files
OnDamage = Callable[[Damage], None]


class Recorded(NamedTuple):
    """One message of a bag."""

    topic: str
    type: str
    time: int  #: time of recording [ns]
    cdr: bytes
    definition: str = ''  #: .msg definitions of the type and its nested types, or '' if the bag has none


def is_bag(path: str | Path) -> bool:
    """Return True if the path is a bag: a file with a bag suffix, or a folder."""
    return Path(path).suffix in BAG_SUFFIXES or Path(path).is_dir()


def records_of(path: str | Path, on_damage: OnDamage, since: int = 0, until: int | None = None) -> Iterator[Recorded]:
    """Yield the messages from all files of a recording.

    Parameters
    ----------
    path
        Path of the bag: a file or a folder.
    on_damage
        Called with each unreadable part before the next message is yielded.
    since, until
        Range of recording times [ns]. Messages with since <= time < until are read.

    Raises
    ------
    LogError
        Raised if the path is not a bag.
    """
    last: float | None = None
    damages: list[Damage] = []
    for found in _found(path, since):
        if isinstance(found, Damage):
            damages.append(found)
            continue
        if until is not None and found.time >= until:
            if found.time >= until + SECOND:  # messages can be out of order by less than a second
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
    """Return the recording time of the first message [ns], or 0 if there is none. Raises LogError."""
    part = bag_parts(path)[0]
    if part.is_there and part.path.suffix == '.mcap':
        with open_mcap(part.path) as file:
            statistics = None if file.summary is None else file.summary.statistics
            if statistics is not None and statistics.message_count:
                return statistics.message_start_time
    first = next(records_of(path, lambda _: None), None)
    return 0 if first is None else first.time


def topics_of(path: str | Path) -> dict[str, str]:
    """Return the type of each topic in the bag.

    Topics in a damaged part may be missing. If the recorder did not finish the bag, the function reads the whole bag.

    Raises
    ------
    LogError
        Raised if the path is not a bag.
    """
    found: dict[str, str] = {}
    for part in bag_parts(path):
        if part.is_there:
            found |= _topics_of_sqlite(part.path) if part.path.suffix == '.db3' else _topics_of_mcap(part.path)
    return found


def decompress(data: bytes) -> bytes:
    """Decompress a message. ``ros2 bag record --compression-mode message`` compresses each message separately."""
    if not data.startswith(b'\x28\xB5\x2F\xFD'):  # magic number of Zstandard (RFC 8878), whereas CDR begins with 00
        return data
    return import_module('zstandard').ZstdDecompressor().decompressobj().decompress(data)


def library(name: str, path: str | Path):
    """Import an optional library for bags. If the library is missing, raise LogError with installation instructions."""
    try:
        return import_module(name)
    except ImportError as error:
        raise LogError(str(path), expected='the libraries needed to read bags', got=str(error),
                       remedy="Install these libraries: pip install 'tactile-skin[bag]'.") from error


def bag_parts(path: str | Path) -> tuple[Part, ...]:
    """Return the .mcap and .db3 files of a bag in recording order. Raises LogError if the bag has no such files."""
    path = Path(path)
    if not path.exists():
        raise LogError(str(path), expected='a bag', got='no such file', remedy='Check the path.')
    parts = parts_of(path)
    if not any(part.is_there for part in parts):
        raise LogError(str(path), expected='a bag with .mcap or .db3 files', got='a folder without such files',
                       remedy='If the bag is compressed, decompress it first (ros2 bag convert).')
    return parts


def _found(path: str | Path, since: int) -> Iterator[Recorded | Damage]:
    for part in bag_parts(path):
        if not part.is_there:
            yield Damage(DamageKind.MISSING_FILE, part.path.name)
        else:
            yield from (_of_sqlite if part.path.suffix == '.db3' else _of_mcap)(part.path, since)


def _one(damages: list[Damage], begin: float | None, end: float | None) -> Damage:
    """Merge all damaged places between two messages into one."""
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
        if not file.channels:  # without a summary, the channels are known only after reading the messages
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
        return {}  # the message reader reports the error


def open_sqlite(path: Path) -> sqlite3.Connection:
    """Open a database read-only and for several threads, because different threads open, play and close a log."""
    return sqlite3.connect(f'{path.resolve().as_uri()}?mode=ro', uri=True, check_same_thread=False)


def _definitions(base: sqlite3.Connection) -> dict[str, str]:
    """Return the message definitions by type. Bags recorded before ROS 2 Iron have no table of definitions."""
    try:
        return dict(base.execute('SELECT topic_type, encoded_message_definition FROM message_definitions '
                                 'WHERE encoding = ?', (MSG_ENCODING,)))
    except sqlite3.OperationalError:
        return {}
