"""The messages of a ROS 2 bag as recorded, in order: .mcap, .db3 (rosbag2), or a bag's folder. Knows no ROS."""

import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from tactile_node.errors import LogError

SUFFIXES = ('.mcap', '.db3')
ZSTANDARD = b'\x28\xB5\x2F\xFD'  # RFC 8878: how such data begin; CDR begins with 00
MSG = 'ros2msg'  #: the encoding of definitions that are written as .msg files


class Recorded(NamedTuple):
    """One message of a bag."""

    topic: str
    type: str
    time: int  #: when it was recorded [ns]
    cdr: bytes
    definition: str = ''  #: of the type and all that it contains, as .msg files; '': not in the bag


def is_bag(path: str | Path) -> bool:
    """Whether it is to be read as a bag: by suffix, or a folder."""
    return Path(path).suffix in SUFFIXES or Path(path).is_dir()


def records_of(path: str | Path) -> Iterator[Recorded]:
    """Read one message after the other. Raises LogError for no bag, EOFError where it is cut short or damaged."""
    return chain.from_iterable(map(_recorded, files_of(Path(path))))


def topics_of(path: str | Path) -> dict[str, str]:
    """Return the type of each topic in the bag, as far as it can be read; quick, unless the bag was not ended.

    Raises LogError for no bag.
    """
    found: dict[str, str] = {}
    for file in files_of(Path(path)):
        try:
            found |= _topics_of_sqlite(file) if file.suffix == '.db3' else _topics_of_mcap(file)
        except EOFError:
            pass  # who reads the messages reports it
    return found


def decompressed(data: bytes) -> bytes:
    """``ros2 bag record --compression-mode message`` compresses each message alone."""
    if not data.startswith(ZSTANDARD):
        return data
    return import_module('zstandard').ZstdDecompressor().decompressobj().decompress(data)


def library(name: str, path: str | Path):
    """Bags are an extra: without them their libraries are not needed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise LogError(str(path), expected='the libraries that bags need', got=str(error),
                       remedy="Install them: pip install 'tactile-skin[bag]'.") from error


def files_of(path: Path) -> list[Path]:
    """Return the .mcap and .db3 files of a bag, in the order in which they were recorded. Raises LogError for none."""
    if not path.exists():
        raise LogError(str(path), expected='a bag', got='no such file', remedy='Check the path.')
    if not path.is_dir():
        return [path]
    files = [file for file in path.iterdir() if file.suffix in SUFFIXES]
    if not files:
        raise LogError(str(path), expected='a bag: .mcap or .db3 files', got='a folder without them',
                       remedy='Decompress a compressed bag first (ros2 bag convert).')
    return sorted(files, key=lambda file: (len(file.name), file.name))  # bag_2 before bag_10


def _recorded(path: Path) -> Iterable[Recorded]:
    return _of_sqlite(path) if path.suffix == '.db3' else _of_mcap(path)


def _of_mcap(path: Path) -> Iterator[Recorded]:
    """Record after record, not by the summary at the end, which a recording that was killed lacks."""
    reader, records = library('mcap.stream_reader', path), library('mcap.records', path)
    schemas, channels, ended = {}, {}, False
    try:
        for record in _records(reader, path):
            if isinstance(record, records.Schema):
                schemas[record.id] = record.name, _definition(record)
            elif isinstance(record, records.Channel):
                channels[record.id] = record
            elif isinstance(record, records.Message):
                channel = channels[record.channel_id]
                kind, definition = schemas.get(channel.schema_id, ('', ''))
                yield Recorded(channel.topic, kind, record.log_time, record.data, definition)
            ended = ended or isinstance(record, records.DataEnd)
    except Exception as error:  # the library lets struct's and zstandard's errors through beside its own
        if not ended:
            raise EOFError(f'cut short or damaged ({type(error).__name__}: {error})') from error
    if not ended:
        raise EOFError('cut short: the recording was not ended')


def _records(reader, path: Path) -> Iterator[object]:
    with path.open('rb') as file:
        yield from reader.StreamReader(file).records


def _definition(schema) -> str:
    return schema.data.decode('utf-8', 'replace') if schema.encoding == MSG else ''


def _topics_of_mcap(path: Path) -> dict[str, str]:
    reader = library('mcap.reader', path)
    try:
        with path.open('rb') as file:
            summary = reader.make_reader(file).get_summary()
    except Exception:  # of a file without its end; as above
        summary = None
    if summary is None or not summary.channels:
        return _topics_seen(path)
    return {channel.topic: summary.schemas[channel.schema_id].name if channel.schema_id in summary.schemas else ''
            for channel in summary.channels.values()}


def _topics_seen(path: Path) -> dict[str, str]:
    found: dict[str, str] = {}
    try:
        for recorded in _of_mcap(path):
            found.setdefault(recorded.topic, recorded.type)
    except EOFError:
        pass  # up to there
    return found


def _of_sqlite(path: Path) -> Iterator[Recorded]:
    try:
        with closing(_opened(path)) as base:
            definitions = _definitions(base)
            for topic, kind, time, data in base.execute(
                    'SELECT topics.name, topics.type, messages.timestamp, messages.data FROM messages '
                    'JOIN topics ON messages.topic_id = topics.id ORDER BY messages.timestamp, messages.id'):
                yield Recorded(topic, kind, time, data, definitions.get(kind, ''))
    except sqlite3.Error as error:
        raise EOFError(f'cut short or damaged ({error})') from error


def _topics_of_sqlite(path: Path) -> dict[str, str]:
    try:
        with closing(_opened(path)) as base:
            return dict(base.execute('SELECT name, type FROM topics'))
    except sqlite3.Error as error:
        raise EOFError(f'damaged ({error})') from error


def _opened(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(f'{path.resolve().as_uri()}?mode=ro', uri=True)


def _definitions(base: sqlite3.Connection) -> dict[str, str]:
    """By type; bags before ROS 2 Iron have no such table."""
    try:
        return dict(base.execute('SELECT topic_type, encoded_message_definition FROM message_definitions '
                                 'WHERE encoding = ?', (MSG,)))
    except sqlite3.OperationalError:
        return {}
