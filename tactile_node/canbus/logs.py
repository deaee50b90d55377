"""CAN logs in the formats python-can knows by suffix: candump ``.log``, ``.asc``, ``.blf``, ``.log.gz``..."""

import threading
import time
import zlib
from collections.abc import Iterator
from pathlib import Path

import can
from can.io import CanutilsLogReader

from tactile_node.errors import LogError

FLUSH_PERIOD = 0.5  # s: what a killed recording may lose


class CanLogWriter:
    """Writes CAN messages to a log as they come; thread-safe.

    An existing file is never overwritten: ``path`` says which one is written, ``session-2.log`` where
    ``session.log`` is there. Text formats are flushed every FLUSH_PERIOD while messages come; the others (.blf)
    hold what python-can buffers. Raises LogError when the file cannot be written or its suffix means no format.
    """

    def __init__(self, path: str | Path):
        self._lock, self._flushed, self.can_frames = threading.Lock(), time.monotonic(), 0
        self.path = _unused(Path(path))
        try:
            self._writer: can.io.MessageWriter | None = can.Logger(str(self.path))
        except (OSError, ValueError, ImportError) as error:
            raise LogError(str(path),
                           expected='a log file that can be written (.log, .log.gz, .asc, .blf, .trc...)',
                           got=str(error), remedy='Check folder, permissions and suffix.') from error

    def write(self, message: can.Message) -> None:
        """Write one message; after ``close`` nothing happens."""
        with self._lock:
            if self._writer is None:
                return
            self._writer.on_message_received(message)
            self.can_frames += 1
            now = time.monotonic()
            if now - self._flushed > FLUSH_PERIOD:
                self._flush()
                self._flushed = now

    def close(self) -> None:
        with self._lock:
            if self._writer is not None:
                self._writer.stop()
                self._writer = None

    def _flush(self) -> None:
        stream = getattr(self._writer, 'file', None)
        if stream is not None:
            stream.flush()


def _unused(path: Path) -> Path:
    """``path``, or with the first number from 2 on that makes it new: log.gz keeps both of its suffixes."""
    suffix = ''.join(path.suffixes[-2:]) if path.suffix == '.gz' else path.suffix
    candidate, number = path, 2
    while candidate.exists():
        candidate = path.with_name(f'{path.name.removesuffix(suffix)}-{number}{suffix}')
        number += 1
    return candidate


class CanLogReader:
    """Iterates over a log's messages; ``unread`` counts lines (or broken rests) left out, ``problem`` why.

    Raises LogError when the file is missing, of no known format, or holds no CAN frame at all.
    """

    def __init__(self, path: str | Path):
        self.path, self.unread, self.problem = str(path), 0, ''
        self.can_frames = 0
        if not Path(path).is_file():
            self._refuse('no such file', 'Check the path.')

    def __iter__(self) -> Iterator[can.Message]:
        self.unread, self.can_frames = 0, 0
        try:
            reader = can.LogReader(self.path)
        except Exception as error:  # each format's reader raises its own errors over a bad header
            self._refuse(f'{type(error).__name__}: {error}',
                         'Give a log in a format and with a suffix python-can reads.')
        with reader:
            yield from self._messages(reader)
        if not self.can_frames:
            self._refuse(f'none{f" ({self.unread} lines unread: {self.problem})" if self.unread else ""}',
                         'Record it again, or check that the suffix fits the content.')

    def _messages(self, reader: can.LogReader) -> Iterator[can.Message]:
        by_lines = isinstance(reader, CanutilsLogReader)
        while True:
            try:
                for message in reader:
                    self.can_frames += 1
                    yield message
                return
            except (EOFError, OSError, UnicodeDecodeError, zlib.error) as error:  # a .gz cut short or damaged, no text
                self._unread(error)
                return
            except Exception as error:  # over a bad line: ValueError, IndexError, KeyError...
                self._unread(error)
                if not by_lines:
                    return

    def _unread(self, error: Exception) -> None:
        self.unread += 1
        self.problem = f'{type(error).__name__}: {error}'

    def _refuse(self, got: str, remedy: str) -> None:
        raise LogError(self.path, expected='a log with CAN frames', got=got, remedy=remedy)
