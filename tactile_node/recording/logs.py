"""CAN logs by suffix: python-can's formats (candump ``.log``, ``.asc``, ``.blf``, ``.log.gz``...) and ROS 2 bags."""

import gzip
import logging
import os
import threading
import zlib
from collections.abc import Iterator
from datetime import datetime, timezone
from pathlib import Path

import can
from can.io import CanutilsLogReader
from can.io.generic import MessageReader, MessageWriter

from tactile_node.errors import LogError
from tactile_node.recording.bag_log import BagCanReader, McapCanWriter, is_bag
from tactile_node.recording.stray_stamps import without_strays

logger = logging.getLogger(__name__)

TEXT_SUFFIXES = ('.log', '.asc', '.trc')
FLUSH_PERIOD = 0.5  # s: what a killed recording may lose


class CanLogWriter:
    """Writes CAN messages to a log as they come; thread-safe.

    An existing file is never overwritten: ``path`` says which one is written, ``session-2.log`` where
    ``session.log`` is there. Every format is flushed every FLUSH_PERIOD (.db by python-can, every 5 s): that much a
    process that is killed may lose.
    ``unwritten`` counts messages that the format cannot hold, or that come after the recording has failed (a full
    disk): it ends then, ``failure`` and the logger say why, and nothing else is harmed. Raises LogError when the
    file cannot be written from the beginning or its suffix means no format.
    """

    def __init__(self, path: str | Path):
        self._lock, self._is_dirty, self.can_frames, self.unwritten = threading.Lock(), False, 0, 0
        self.failure = ''
        try:
            self.path = _unused(Path(path))
            self._writer = McapCanWriter(self.path) if self.path.suffix == '.mcap' else can.Logger(str(self.path))
        except (OSError, ValueError, ImportError) as error:
            raise LogError(str(path),
                           expected='a log file that can be written (.log, .log.gz, .asc, .blf, .trc, .mcap...)',
                           got=str(error), remedy='Check folder, permissions and suffix.') from error
        self._closed = threading.Event()
        threading.Thread(target=self._keep_flushed, name='log', daemon=True).start()

    def write(self, message: can.Message) -> None:
        """Write one message; after ``close`` nothing happens."""
        with self._lock:
            if self._writer is None:
                self.unwritten += bool(self.failure)
                return
            if isinstance(self._writer, can.TRCWriter) and not _fits_trc(message):
                self.unwritten += 1
                return
            try:
                self._writer.on_message_received(message)
                self.can_frames += 1
                self._is_dirty = True
            except ValueError:  # the format has no place for it
                self.unwritten += 1
            except OSError as error:
                self.unwritten += 1
                self._end(error)

    def close(self) -> None:
        self._closed.set()
        with self._lock:
            self._end()

    def _keep_flushed(self) -> None:
        while not self._closed.wait(FLUSH_PERIOD):
            with self._lock:
                try:
                    if self._is_dirty and self._writer is not None:
                        flush(self._writer)
                except OSError as error:
                    self._end(error)
                self._is_dirty = False

    def _end(self, failure: OSError | None = None) -> None:
        """Stop the writer. After a ``failure`` what is on the disk stays, what the writer still holds is lost."""
        writer, self._writer = self._writer, None
        try:
            if writer is not None:
                writer.stop()
        except OSError as error:
            failure = failure or error
        if failure is not None and not self.failure:
            self.failure = (f'The recording {self.path} has ended after {self.can_frames} CAN frames: '
                            f'{failure.strerror or failure}. Free the disk, or record elsewhere.')
            logger.error('%s', self.failure, extra={'fact': failure})


def flush(writer: MessageWriter | McapCanWriter) -> None:
    """Bring all that was written so far into the file, as a reader needs it."""
    stream = getattr(writer, 'file', None)
    if isinstance(writer, can.BLFWriter):  # python-can buffers 128 KiB and tells the begin only at the end
        _write_blf_header(writer)  # first: stamps count from the begin that it tells
        writer._flush()
        _write_blf_header(writer)
    if stream is not None:
        stream.flush()


def _write_blf_header(writer: can.BLFWriter) -> None:
    """Tell the begin and the size so far, on disk before anything else is written."""
    end = writer.file.tell()
    writer.file.seek(0)
    writer._write_header(end)
    writer.file.seek(end)
    writer.file.flush()


def _unused(path: Path) -> Path:
    """``path``, or with the first number from 2 on that makes it new: log.gz keeps both of its suffixes."""
    suffix = ''.join(path.suffixes[-2:]) if path.suffix == '.gz' else path.suffix
    candidate, number = path, 2
    while candidate.exists():
        candidate = path.with_name(f'{path.name.removesuffix(suffix)}-{number}{suffix}')
        number += 1
    return candidate


def _fits_trc(message: can.Message) -> bool:
    """Others python-can leaves out of a .trc with no more than a line on its logger."""
    return not (message.is_error_frame or message.is_remote_frame or message.is_fd)


def _reader(path: str) -> MessageReader:
    """python-can's; ASC files tell when they begin, and only when asked their stamps do too."""
    suffixes = Path(path).suffixes[-2:]
    if '.asc' not in suffixes:
        return can.LogReader(path)
    return can.ASCReader(gzip.open(path, 'rt') if suffixes[-1] == '.gz' else path, relative_timestamp=False)


def _shortfall(reader: MessageReader | BagCanReader, path: Path) -> str:
    """What lets a log that was read without complaint look cut short; '' when nothing does."""
    if isinstance(reader, can.BLFReader) and path.stat().st_size < reader.file_size:
        return f'cut short: {path.stat().st_size} of {reader.file_size} bytes'
    return ''


def _ends_within_a_line(path: Path) -> bool:
    """Whether a text log's last line lacks its end: what is left of it may read as another frame."""
    if path.suffix not in TEXT_SUFFIXES or not path.stat().st_size:
        return False
    with path.open('rb') as file:
        file.seek(-1, os.SEEK_END)
        return file.read() not in (b'\n', b'\r')


class CanLogReader:
    """Iterates over a log's messages; ``unread`` counts lines (or broken rests) left out, ``problem`` says why.

    Of a log of several buses only ``channel`` is read where it is given: as the log calls it, or a bag's topic. A frame
    whose stamp is far from its neighbours' is left out as unread. Of a log cut short, by a full disk or in a download,
    what is whole is given; ``told`` says where it ends.

    Raises LogError when the file is missing, of no known format, or holds no CAN frame at all.
    """

    def __init__(self, path: str | Path, channel: str = ''):
        self.path, self._channel, self.unread, self.problem = str(path), channel, 0, ''
        self.can_frames, self._last = 0, 0.0
        if not Path(path).is_file() and not (Path(path).is_dir() and is_bag(path)):
            self._refuse('no file' if Path(path).exists() else 'no such file', 'Check the path.')

    def __iter__(self) -> Iterator[can.Message]:
        self.unread, self.can_frames, self._others = 0, 0, set()
        try:
            reader = BagCanReader(self.path) if is_bag(self.path) else _reader(self.path)
        except LogError:
            raise
        except Exception as error:  # each format's reader raises its own errors over a bad header
            self._refuse(f'{type(error).__name__}: {error}',
                         'Give a log in a format and with a suffix python-can reads.')
        with reader:
            messages, is_cut = self._messages(reader), _ends_within_a_line(Path(self.path))
            whole = self._without_last_line(messages) if is_cut else messages
            yield from self._counted(without_strays(self._of_channel(whole), self._stray))
        if not is_cut and not self.unread and (shortfall := _shortfall(reader, Path(self.path))):
            self._unread(shortfall)
        if not self.can_frames and self._others:
            self._refuse(f'none of channel {self._channel!r}, but of {", ".join(sorted(self._others))}',
                         'Name one of these.')
        if not self.can_frames:
            self._refuse(f'none{f" ({self.unread} lines unread: {self.problem})" if self.unread else ""}',
                         'Record it again, or check that the suffix fits the content.')

    @property
    def told(self) -> str:
        """What was read, in a sentence: for the end of the log."""
        end = datetime.fromtimestamp(self._last, timezone.utc).isoformat(' ', 'milliseconds').replace('+00:00', ' UTC')
        rest = f'; {self.unread} lines or rests unread: {self.problem}' if self.unread else ''
        return f'{self.can_frames} CAN frames, the last at {end}{rest}.'

    def _of_channel(self, messages: Iterator[can.Message]) -> Iterator[can.Message]:
        for message in messages:
            if self._channel in ('', str(message.channel)):
                yield message
            else:
                self._others.add(str(message.channel))

    def _stray(self, message: can.Message) -> None:
        self._unread(f'a stamp of {message.timestamp:.6f} s, far from its neighbours')

    def _counted(self, messages: Iterator[can.Message]) -> Iterator[can.Message]:
        for message in messages:
            self.can_frames += 1
            self._last = message.timestamp
            yield message

    def _without_last_line(self, messages: Iterator[can.Message]) -> Iterator[can.Message]:
        """The last message is of the line cut short, unless the parser has refused that line."""
        last, unread = next(messages, None), self.unread
        for message in messages:
            yield last
            last, unread = message, self.unread
        if self.unread == unread:
            self._unread('')
        elif last is not None:
            yield last
        self.problem = 'cut short: it ends within a line, of which nothing is used'

    def _messages(self, reader: MessageReader | BagCanReader) -> Iterator[can.Message]:
        by_lines = isinstance(reader, CanutilsLogReader)
        while True:
            try:
                yield from reader
                return
            except LogError:
                raise
            except (EOFError, OSError, UnicodeDecodeError, zlib.error) as error:  # a .gz cut short or damaged, no text
                self._unread(error)
                return
            except Exception as error:  # over a bad line: ValueError, IndexError, KeyError...
                self._unread(error)
                if not by_lines:
                    return

    def _unread(self, problem: Exception | str) -> None:
        self.unread += 1
        self.problem = problem if isinstance(problem, str) else f'{type(problem).__name__}: {problem}'

    def _refuse(self, got: str, remedy: str) -> None:
        raise LogError(self.path, expected='a log with CAN frames', got=got, remedy=remedy)
