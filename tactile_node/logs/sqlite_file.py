"""Read the messages of one .db3 file of a bag, and open SQLite databases."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from tactile_node.logs.damage import Damage, DamageKind
from tactile_node.logs.recorded import MSG_ENCODING, Recorded


class SqliteFile:
    """Reader for a .db3 file of rosbag2, with the interface of `McapFile`."""

    begin: int | None = None  #: unknown without reading the messages

    def __init__(self, path: Path):
        self._path = path

    def topics(self) -> dict[str, str]:
        """Return the message type of each topic, or nothing if the file is damaged, which `read` reports."""
        try:
            with closing(open_sqlite(self._path)) as base:
                return dict(base.execute('SELECT name, type FROM topics'))
        except sqlite3.Error:
            return {}

    def read(self, since: int = 0) -> Iterator[Recorded | Damage]:
        """Yield the messages recorded at ``since`` [ns] or later, and a `Damage` for each damaged part of the file."""
        try:
            with closing(open_sqlite(self._path)) as base:
                definitions = _definitions(base)
                for topic, kind, time, data in base.execute(
                        'SELECT topics.name, topics.type, messages.timestamp, messages.data FROM messages '
                        'LEFT JOIN topics ON messages.topic_id = topics.id WHERE messages.timestamp >= ? '
                        'ORDER BY messages.timestamp, messages.id', (since,)):
                    if isinstance(topic, str) and isinstance(kind, str) and isinstance(time, int):
                        yield Recorded(topic, kind, time, data, definitions.get(kind, ''))
                    else:  # a damaged database may hold values of any type
                        yield Damage(DamageKind.RECORDS, self._path.name, detail='a row without a topic or a time')
        except sqlite3.Error as error:
            yield Damage(DamageKind.DATABASE, self._path.name, detail=str(error))


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
