"""Write CAN logs (.log, .log.gz, .mcap) to a single file, or to several files of limited size."""

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

WRITTEN_SUFFIXES = ('.log', '.log.gz', '.mcap')  #: formats that can be written
FLUSH_PERIOD = 0.5  #: time between two flushes [s], and the longest period that a killed recording loses
MEGABYTE = 1_000_000  #: [bytes]


class LogFile:
    """Writes CAN messages to an empty file in the format of its suffix. The class is not thread-safe.

    Attributes
    ----------
    can_frames
        Number of messages written.

    Raises
    ------
    OSError, ValueError, ImportError
        Raised if the file cannot be written in this format. A file that cannot be written is removed.
    """

    def __init__(self, path: Path):
        self.path = path
        self.can_frames = 0
        self._flushed = self._size = 0  # CAN frames and bytes on the disk after the last flush
        try:
            self.writer: Any = McapCanWriter(path) if path.suffix == '.mcap' else can.Logger(str(path))
        except (OSError, ValueError, ImportError):
            path.unlink(missing_ok=True)
            raise

    @property
    def is_dirty(self) -> bool:
        return self.can_frames > self._flushed

    def reaches(self, largest: int) -> bool:
        """Return True if the file, with all messages written so far, has at least ``largest`` bytes. Raises OSError."""
        if isinstance(self.writer, McapCanWriter) and self.writer.file.tell() + CHUNK_BYTES < largest:
            return False  # this check needs no flush, because a flush would end the chunk
        self.flush()
        return self._size >= largest

    def write(self, message: can.Message) -> None:
        """Write a message. Raises ValueError if the message does not fit the format, or OSError if the disk is full."""
        self.writer.on_message_received(message)
        self.can_frames += 1

    def flush(self) -> None:
        """Flush all messages written so far to the file, so that a reader can read them. Raises OSError."""
        if isinstance(self.writer, McapCanWriter):
            self.writer.flush()
        self.writer.file.flush()
        self._flushed, self._size = self.can_frames, self.path.stat().st_size

    def close(self) -> None:
        """Write remaining messages and close the file. If `close` raises OSError, the caller must call `cut_back`."""
        self.flush()
        self.writer.stop()

    def cut_back(self) -> int:
        """Truncate the file after the last flushed frame, and return the number of lost frames.

        After an OSError, a full disk may hold only half of the last frame. Without the truncation, the number of lost
        frames would be unknown.
        """
        try:
            self.writer.stop()
        except (OSError, ValueError):  # remaining data cannot be written, or the file is already closed
            pass
        with self.path.open('r+b') as file:
            file.truncate(self._size)
        lost, self.can_frames = self.can_frames - self._flushed, self._flushed
        return lost


class CanLogWriter:
    """Writes CAN messages to a log as they are received. The class is thread-safe.

    The log is flushed every FLUSH_PERIOD, so a killed process loses at most the messages of one period.

    Parameters
    ----------
    path
        File to write. If the file exists and ``replaces`` is False, the log gets another name, such as
        ``session-2.log``.
    channel
        Bus name for messages without a name, such as sent messages and messages from some adapters. Only the last part
        of a device path is used.
    largest
        Size at which a new file is started [bytes], or 0 for a single file. Further files are named
        ``session_part2.log`` and so on. Each file can be read alone, and a reader given the first file reads all files
        as one log. No frame is lost between files.
    replaces
        True to overwrite an existing log.

    Attributes
    ----------
    path
        File that is being written.
    parts
        Number of files.
    can_frames
        Number of recorded messages.
    unwritten
        Number of messages that do not fit the format or arrived after the recording had failed.
    failure
        Reason why the recording failed, for example a full disk, or '' if it did not fail. The reason is also logged.
        After a failure, the recording ends with the last flushed frame, and the rest of the process continues.

    Raises
    ------
    LogError
        Raised if the file cannot be created, or if its suffix is not supported.
    """

    def __init__(self, path: str | Path, channel: str = '', largest: int = 0, *, replaces: bool = False):
        # spaces are replaced, because log formats use them as separators
        self._channel = '_'.join(channel.rsplit('/')[-1].split()) or None
        self._largest = largest
        self._lock = threading.Lock()
        self._recorded = 0  # number of messages in the earlier files
        self.parts = 1
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
                           got=str(error), remedy='Check the folder, the permissions and the suffix.') from error
        self._closed = threading.Event()
        ReportedThread(self._keep_flushed, 'log').start()

    @property
    def can_frames(self) -> int:
        return self._recorded + self._last.can_frames

    def write(self, message: can.Message) -> None:
        """Write one message, or do nothing after `close`."""
        with self._lock:
            if self._file is None:
                self.unwritten += bool(self.failure)
                return
            if message.channel is None:
                message.channel = self._channel
            try:
                self._file.write(message)
            except ValueError:  # the message does not fit the format
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
        """Start a new file if ``file`` has reached the size limit."""
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
        """End the recording if the disk refuses more data."""
        try:
            yield
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        """End the recording. Flushed data remain on the disk, and buffered data are lost."""
        file, self._file = self._file, None
        if file is not None:
            self.unwritten += file.cut_back()
        self._report(error)

    def _report(self, error: Exception) -> None:
        self.failure = (f'The recording {self._last.path} ended after {self.can_frames} CAN frames: '
                        f'{getattr(error, "strerror", "") or error}. Free space on the disk, or record elsewhere.')
        logger.error('%s', self.failure, extra={'fact': error})


def _check_suffix(path: Path) -> None:
    suffix = suffix_of(path)
    if suffix.lower() not in WRITTEN_SUFFIXES:
        log = f'{str(path).removesuffix(suffix)}.log'
        raise LogError(str(path), expected=f'a log file that can be written: {", ".join(WRITTEN_SUFFIXES)}',
                       got=f'the suffix {suffix!r}' if suffix else 'no suffix',
                       remedy=f'Record to {log}; python-can converts it to other formats: '
                              f'python -m can.logconvert {log} {path}.' if suffix else 'Name it session.log.')


def _new_file(path: Path, replaces: bool) -> Path:
    """Create the file for a recording and return its path.

    If ``path`` or a later part of its series exists, a number is appended to the name, starting at 2. The file is
    created immediately, so that a recording that starts at the same time chooses another number. With ``replaces``, all
    existing files of the series are removed first.
    """
    suffix = suffix_of(path)
    for old in files_of(path) if replaces else ():
        old.unlink(missing_ok=True)
    candidate, number = path, 2
    while True:
        try:
            if not following(candidate):  # a reader would treat existing later parts as parts of the new log
                candidate.open('xb').close()
                return candidate
        except FileExistsError:
            pass
        candidate = path.with_name(f'{path.name.removesuffix(suffix)}-{number}{suffix}')
        number += 1
