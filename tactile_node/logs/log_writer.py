"""Writes CAN logs (.log, .log.gz, .mcap), in one file or in several of limited size."""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can

from tactile_node.errors import LogError
from tactile_node.logs.bag_log import CHUNK_BYTES, McapCanWriter
from tactile_node.logs.series import files_of, following, part, suffix_of
from tactile_node.threads import ReportedThread

logger = logging.getLogger(__name__)

WRITTEN_SUFFIXES = ('.log', '.log.gz', '.mcap')  #: what is written
FLUSH_PERIOD = 0.5  # s: what a killed recording loses at most
MEGABYTE = 1_000_000  # bytes


class LogFile:
    """Writes CAN messages to ``path``, an empty file, in the format of its suffix; not thread-safe.

    ``can_frames``: how many it has taken. Raises OSError, ValueError, ImportError where nothing can write to it; the
    file is then removed.
    """

    def __init__(self, path: Path):
        self.path = path
        self.can_frames = 0
        self._flushed = self._size = 0  # CAN frames and bytes that the last flush brought to the disk
        try:
            self.writer: Any = McapCanWriter(path) if path.suffix == '.mcap' else can.Logger(str(path))
        except (OSError, ValueError, ImportError):
            path.unlink(missing_ok=True)
            raise

    @property
    def is_dirty(self) -> bool:
        return self.can_frames > self._flushed

    def reaches(self, largest: int) -> bool:
        """Return whether the file has ``largest`` bytes, with all that was written so far. Raises OSError."""
        if isinstance(self.writer, McapCanWriter) and self.writer.file.tell() + CHUNK_BYTES < largest:
            return False  # without a flush, which would end its chunk
        self.flush()
        return self._size >= largest

    def write(self, message: can.Message) -> None:
        """Raises ValueError for a message that the format cannot hold, OSError where the disk takes no more."""
        self.writer.on_message_received(message)
        self.can_frames += 1

    def flush(self) -> None:
        """Bring all that was written so far into the file, as a reader needs it. Raises OSError."""
        if isinstance(self.writer, McapCanWriter):
            self.writer.flush()
        self.writer.file.flush()
        self._flushed, self._size = self.can_frames, self.path.stat().st_size

    def close(self) -> None:
        """Write what is left and end the file. Raises OSError: ``cut_back`` has to follow."""
        self.flush()
        self.writer.stop()

    def cut_back(self) -> int:
        """After an OSError, end the file with the last frame flushed; return how many taken since are lost.

        Else a disk that took a part of the rest would leave half a frame, and no one could say how many are lost.
        """
        try:
            self.writer.stop()
        except (OSError, ValueError):  # what it still holds; a file that is closed
            pass
        with self.path.open('r+b') as file:
            file.truncate(self._size)
        lost, self.can_frames = self.can_frames - self._flushed, self._flushed
        return lost


class CanLogWriter:
    """Writes CAN messages to a log as they are received; thread-safe.

    An existing file is never overwritten unless this one ``replaces`` it: ``path`` is the one that is written,
    ``session-2.log`` where ``session.log`` exists. From ``largest`` bytes on (0: never) the next file begins,
    ``session_part2.log`` and so on; each can be read alone, all as one by the first, and no frame is lost between two.
    It is flushed every FLUSH_PERIOD: a killed process loses at most that. A message without the name of its bus (what
    this package sends, and what some adapters receive) gets ``channel``, a device's path without its folder.
    ``can_frames`` counts what was recorded, ``unwritten`` messages that the format cannot hold, and those missing after
    the recording has failed (a full disk): it ends then, with the last frames flushed, ``failure`` has the reason,
    which is also logged, and nothing else is affected. Raises LogError when the file cannot be written from the
    beginning or its suffix means no format.
    """

    def __init__(self, path: str | Path, channel: str = '', largest: int = 0, *, replaces: bool = False):
        self._channel = '_'.join(channel.rsplit('/')[-1].split()) or None  # formats separate by spaces
        self._largest = largest
        self._lock = threading.Lock()
        self._recorded = 0  # in the files before this one
        self.parts = 1  #: files there are
        self.unwritten = 0
        self.failure = ''
        self._file: LogFile | None = None
        _check_suffix(Path(path))
        try:
            self.path = _new_file(Path(path), replaces)
            self._file = self._last = LogFile(self.path)
        except (OSError, ValueError, ImportError) as error:
            raise LogError(str(path),
                           expected='a log file that can be written',
                           got=str(error), remedy='Check folder, permissions and suffix.') from error
        self._closed = threading.Event()
        ReportedThread(self._keep_flushed, 'log').start()

    @property
    def can_frames(self) -> int:
        return self._recorded + self._last.can_frames

    def write(self, message: can.Message) -> None:
        """Write one message; after ``close`` nothing happens."""
        with self._lock:
            if self._file is None:
                self.unwritten += bool(self.failure)
                return
            if message.channel is None:
                message.channel = self._channel
            try:
                self._file.write(message)
            except ValueError:  # the format has no place for it
                self.unwritten += 1
            except OSError as error:
                self.unwritten += 1
                self._fail(error)
            else:
                self._limit(self._file)

    def close(self) -> None:
        self._closed.set()
        with self._lock:
            if self._file is not None:
                with self._failing():
                    self._file.close()
                    self._file = None

    def _keep_flushed(self) -> None:
        while not self._closed.wait(FLUSH_PERIOD):
            with self._lock:
                if self._file is not None and self._file.is_dirty:
                    with self._failing():
                        self._file.flush()

    def _limit(self, file: LogFile) -> None:
        """Begin the next file where this one is large enough."""
        if not self._largest or file.can_frames % 256:
            return
        with self._failing():
            if file.reaches(self._largest):
                file.close()
                self._file = None
                self._begin_part()

    def _begin_part(self) -> None:
        try:
            path = part(self.path, self.parts + 1)
            path.open('xb').close()
            self._file = LogFile(path)
        except (OSError, ValueError, ImportError) as error:
            self._report(error)
            return
        self._recorded += self._last.can_frames
        self._last = self._file
        self.parts += 1

    @contextmanager
    def _failing(self) -> Iterator[None]:
        """End the recording where the disk takes no more."""
        try:
            yield
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        """What is on the disk stays, what the file still holds is lost."""
        file, self._file = self._file, None
        if file is not None:
            self.unwritten += file.cut_back()
        self._report(error)

    def _report(self, error: Exception) -> None:
        self.failure = (f'The recording {self._last.path} has ended after {self.can_frames} CAN frames: '
                        f'{getattr(error, "strerror", "") or error}. Free the disk, or record elsewhere.')
        logger.error('%s', self.failure, extra={'fact': error})


def _check_suffix(path: Path) -> None:
    suffix = suffix_of(path)
    if suffix.lower() not in WRITTEN_SUFFIXES:
        log = f'{str(path).removesuffix(suffix)}.log'
        raise LogError(str(path), expected=f'a log file that can be written: {", ".join(WRITTEN_SUFFIXES)}',
                       got=f'the suffix {suffix!r}' if suffix else 'no suffix',
                       remedy=f'Record to {log}; python-can makes other formats of it: '
                              f'python -m can.logconvert {log} {path}.' if suffix else 'Name it session.log.')


def _new_file(path: Path, replaces: bool) -> Path:
    """Make ``path``, or with the first number from 2 on that makes it new, as are the files that may follow it.

    It exists from then on, so that another recording, started together with this one, gets another number. What it
    ``replaces`` is removed, with the files that follow.
    """
    suffix = suffix_of(path)
    for old in files_of(path) if replaces else ():
        old.unlink(missing_ok=True)
    candidate, number = path, 2
    while True:
        try:
            if not following(candidate):  # or a reader would take them for its own
                candidate.open('xb').close()
                return candidate
        except FileExistsError:
            pass
        candidate = path.with_name(f'{path.name.removesuffix(suffix)}-{number}{suffix}')
        number += 1
