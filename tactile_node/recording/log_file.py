"""One file of a recording, in the format of its suffix: python-can's that can be replayed, and MCAP."""

import time
from pathlib import Path
from typing import NamedTuple

import can
from can.io.generic import MessageWriter

from tactile_node.recording.bag_log import CHUNK, McapCanWriter

SUFFIXES = ('.log', '.log.gz', '.asc', '.asc.gz', '.blf', '.csv', '.trc', '.db', '.mcap')  #: what can be replayed
BLF_HEADER = 144  # bytes
DRAIN = 1e-3  # s between two looks at what waits


class _OnDisk(NamedTuple):
    """What the last flush brought there."""

    can_frames: int
    size: int  # bytes
    begin: bytes  # of the file, where its header is written again and again


class LogFile:
    """Writes CAN messages to ``path``, an empty file; not thread-safe. ``can_frames``: how many it has taken.

    Raises OSError, ValueError, ImportError where nothing can write to it; the file is then removed.
    """

    def __init__(self, path: Path):
        self.path = path
        self.can_frames = 0
        self.writer = _writer(path)
        self._on_disk = _OnDisk(0, 0, b'')

    @property
    def is_dirty(self) -> bool:
        return self.can_frames > self._on_disk.can_frames

    def reaches(self, largest: int) -> bool:
        """Return whether the file has ``largest`` bytes, with all that was written so far. Raises OSError."""
        if isinstance(self.writer, McapCanWriter) and self.writer.file.tell() + CHUNK < largest:
            return False  # without a flush, which would end its chunk
        self.flush()
        return self._on_disk.size >= largest

    def write(self, message: can.Message) -> None:
        """Raises ValueError for a message that the format cannot hold, OSError where the disk takes no more."""
        if isinstance(self.writer, can.TRCWriter) and not _fits_trc(message):
            raise ValueError('a frame that does not fit into a .trc')
        self.writer.on_message_received(message)
        self.can_frames += 1

    def flush(self) -> None:
        """Bring all that was written so far into the file, as a reader needs it. Raises OSError."""
        flush(self.writer)
        if isinstance(self.writer, can.SqliteWriter) and not self.writer._writer_thread.is_alive():
            raise OSError('the thread that writes the database has ended')
        with self.path.open('rb') as file:
            begin = file.read(BLF_HEADER) if isinstance(self.writer, can.BLFWriter) else b''
        self._on_disk = _OnDisk(self.can_frames, self.path.stat().st_size, begin)

    def close(self) -> None:
        """Write what is left and end the file. Raises OSError: ``cut_back`` has to follow."""
        self.flush()
        self._wait_for_database()
        self.writer.stop()
        if isinstance(self.writer, can.SqliteWriter) and self.writer.num_frames < self.can_frames:
            raise OSError('the last frames do not fit into the database')

    def _wait_for_database(self) -> None:
        """python-can's thread leaves all after the next 501 frames out once it is stopped."""
        while isinstance(self.writer, can.SqliteWriter) and self.writer._writer_thread.is_alive() \
                and not self.writer.buffer.empty():
            time.sleep(DRAIN)

    def cut_back(self) -> int:
        """After an OSError, end the file with the last frame flushed; return how many taken since are lost.

        Else a disk that took a part of the rest would leave half a frame, and no one could say how many are lost.
        """
        try:
            self.writer.stop()
        except (OSError, ValueError):  # what it still holds; a file that is closed
            pass
        taken, kept = self.can_frames, self._on_disk.can_frames
        if isinstance(self.writer, can.SqliteWriter):  # commits whole transactions without a flush
            kept = self.writer.num_frames
        else:
            with self.path.open('r+b') as file:
                file.truncate(self._on_disk.size)
                file.write(self._on_disk.begin)
        self.can_frames = kept
        return taken - kept


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
    if isinstance(writer, McapCanWriter):
        writer.flush()
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


def _fits_trc(message: can.Message) -> bool:
    """python-can leaves all others out of a .trc, and only logs it."""
    return not (message.is_error_frame or message.is_remote_frame or message.is_fd)
