"""Writes CAN logs by suffix: python-can's formats that can be replayed, and MCAP."""

import logging
import threading
from pathlib import Path

import can
from can.io.generic import MessageWriter

from tactile_node.errors import LogError
from tactile_node.recording.bag_log import McapCanWriter

logger = logging.getLogger(__name__)

FLUSH_PERIOD = 0.5  # s: what a killed recording loses at most
SUFFIXES = ('.log', '.log.gz', '.asc', '.asc.gz', '.blf', '.csv', '.trc', '.db', '.mcap')  #: what can be replayed


class CanLogWriter:
    """Writes CAN messages to a log as they are received; thread-safe.

    An existing file is never overwritten: ``path`` is the one that is written, ``session-2.log`` where
    ``session.log`` exists. Every format is flushed every FLUSH_PERIOD (.db by python-can, every 5 s): a killed
    process loses at most that. A message without the name of its bus (``channel``; what this package sends, and what
    some adapters receive) gets ``channel``, a device's path without its folder.
    ``unwritten`` counts messages that the format cannot hold, and those after the recording has failed (a full
    disk): it ends then, ``failure`` has the reason, which is also logged, and nothing else is affected. Raises
    LogError when the file cannot be written from the beginning or its suffix means no format.
    """

    def __init__(self, path: str | Path, channel: str = ''):
        self._channel = '_'.join(channel.rsplit('/')[-1].split()) or None  # formats separate by spaces
        self._lock = threading.Lock()
        self._is_dirty = False
        self.can_frames = 0
        self.unwritten = 0
        self.failure = ''
        self._writer: MessageWriter | McapCanWriter | None
        try:
            self.path = _new_file(Path(path))
            self._writer = _writer(self.path)
        except (OSError, ValueError, ImportError) as error:
            raise LogError(str(path),
                           expected=f'a log file that can be written ({", ".join(SUFFIXES)})',
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
            if message.channel is None:
                message.channel = self._channel
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


def _writer(path: Path) -> MessageWriter | McapCanWriter:
    """Return what writes to ``path``, an empty file, which is removed where nothing can."""
    try:
        return McapCanWriter(path) if path.suffix == '.mcap' else can.Logger(str(path))
    except (OSError, ValueError, ImportError):
        path.unlink(missing_ok=True)
        raise


def flush(writer: MessageWriter | McapCanWriter) -> None:
    """Bring all that was written so far into the file, as a reader needs it."""
    stream = getattr(writer, 'file', None)
    if isinstance(writer, can.BLFWriter):  # python-can buffers 128 KiB and writes the begin only at the end
        _write_blf_header(writer)  # first: stamps count from the begin in it
        writer._flush()
        _write_blf_header(writer)
    if stream is not None:
        stream.flush()


def _write_blf_header(writer: can.BLFWriter) -> None:
    """Write the begin and the size so far, to the disk before anything else."""
    end = writer.file.tell()
    writer.file.seek(0)
    writer._write_header(end)
    writer.file.seek(end)
    writer.file.flush()


def _new_file(path: Path) -> Path:
    """Make ``path``, or with the first number from 2 on that makes it new: log.gz keeps both of its suffixes.

    It exists from then on, so that another recording, started together with this one, gets another number.
    """
    suffix = ''.join(path.suffixes[-2:]) if path.suffix == '.gz' else path.suffix
    if suffix.lower() not in SUFFIXES:
        raise ValueError(f'the suffix {suffix!r}, whose logs cannot be replayed' if suffix else 'no suffix')
    candidate, number = path, 2
    while True:
        try:
            candidate.open('xb').close()
            return candidate
        except FileExistsError:
            candidate = path.with_name(f'{path.name.removesuffix(suffix)}-{number}{suffix}')
            number += 1


def _fits_trc(message: can.Message) -> bool:
    """python-can leaves all others out of a .trc, and only logs it."""
    return not (message.is_error_frame or message.is_remote_frame or message.is_fd)
