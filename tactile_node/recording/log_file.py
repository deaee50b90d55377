"""One file of a recording, in the format of its suffix: candump's text, or MCAP."""

from pathlib import Path
from typing import Any

import can

from tactile_node.recording.bag_log import CHUNK, McapCanWriter

SUFFIXES = ('.log', '.log.gz', '.mcap')  #: what is written


class LogFile:
    """Writes CAN messages to ``path``, an empty file; not thread-safe. ``can_frames``: how many it has taken.

    Raises OSError, ValueError, ImportError where nothing can write to it; the file is then removed.
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
        if isinstance(self.writer, McapCanWriter) and self.writer.file.tell() + CHUNK < largest:
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
