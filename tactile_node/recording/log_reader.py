"""Reads CAN logs: candump's by their text, python-can's others by suffix (``.asc``, ``.blf``...), and ROS 2 bags."""

import gzip
import os
import re
import zlib
from collections.abc import Iterator
from datetime import datetime, timezone
from io import BufferedReader
from pathlib import Path
from typing import NoReturn

import can
from can.io import CanutilsLogReader
from can.io.generic import MessageReader

from tactile_node.errors import LogError
from tactile_node.recording.bag_log import BagCanReader, is_bag
from tactile_node.recording.log_channels import ChosenChannel
from tactile_node.recording.stray_stamps import without_strays

TEXT_SUFFIXES = ('.log', '.asc', '.trc')
CANDUMP = re.compile(rb'\(\d+\.\d+\) \S+ [0-9A-Fa-f]{3,8}#')                #: `candump -L`
CONSOLE = re.compile(rb'\s*(\([\d. :-]+\)\s+)?\S+\s+[0-9A-Fa-f]{3,8}\s+\[\d+\]')  #: `candump can0`, for people
GZIP, HEAD = b'\x1f\x8b', 4096


def _reader(path: str) -> MessageReader:
    """python-can's; ASC files hold their begin, and only with this option their stamps count from it."""
    suffixes = [suffix.lower() for suffix in Path(path).suffixes[-2:]]
    is_gzip = _is_gzip(path)
    with gzip.open(path) if is_gzip else open(path, 'rb') as stream:
        head = _head(stream)
    if CANDUMP.match(head):
        return CanutilsLogReader(gzip.open(path, 'rt') if is_gzip else path)
    if CONSOLE.match(head):
        raise LogError(path, expected='a log with the stamps of its CAN frames', got='what candump shows on a terminal',
                       remedy='Record with `tactile record`, or with candump -L.')
    if '.asc' not in suffixes:
        return can.LogReader(path)
    return can.ASCReader(gzip.open(path, 'rt') if is_gzip else path, relative_timestamp=False)


def _is_gzip(path: str | Path) -> bool:
    with open(path, 'rb') as file:
        return file.read(len(GZIP)) == GZIP


def _head(stream: gzip.GzipFile | BufferedReader) -> bytes:
    try:
        return stream.read(HEAD)
    except (EOFError, OSError, zlib.error):  # damaged: what reads it all says where
        return b''


def _shortfall(reader: MessageReader | BagCanReader, path: Path) -> str:
    """Why a log that was read without an error is cut short all the same; '' when it is not."""
    if isinstance(reader, can.BLFReader) and path.stat().st_size < reader.file_size:
        return f'cut short: {path.stat().st_size} of {reader.file_size} bytes'
    return ''


def _ends_within_a_line(path: Path) -> bool:
    """Whether a text log's last line lacks its end: what is left of it may read as another frame."""
    if not path.stat().st_size or _is_gzip(path):  # whose end is checked by gzip
        return False
    with path.open('rb') as file:
        file.seek(-1, os.SEEK_END)
        return file.read() not in (b'\n', b'\r')


class CanLogReader:
    """Iterates over a log's messages; ``unread`` counts lines (or broken rests) left out, ``problem`` is the reason.

    Of a log of several buses only ``channel`` is read where it is given: as the log calls it, or a bag's topic. A frame
    whose stamp is far from its neighbours' is left out as unread. Of a log cut short, by a full disk or in a download,
    what is whole is given; ``summary`` has where it ends.

    Raises LogError when the file is missing, of no known format, or holds no CAN frame at all.
    """

    def __init__(self, path: str | Path, channel: str = ''):
        self.path = str(path)
        self._channel = channel
        self.unread = 0
        self.problem = ''
        self.can_frames = 0
        self._last = 0.0  # stamp
        self._chosen = ChosenChannel(channel)
        if not Path(path).is_file() and not (Path(path).is_dir() and is_bag(path)):
            self._refuse('no file' if Path(path).exists() else 'no such file', 'Check the path.')

    def __iter__(self) -> Iterator[can.Message]:
        self.unread = 0
        self.can_frames = 0
        self._chosen = ChosenChannel(self._channel)
        try:
            reader = BagCanReader(self.path) if is_bag(self.path) else _reader(self.path)
        except LogError:
            raise
        except Exception as error:  # each format's reader raises its own errors over a bad header
            self._refuse(f'{type(error).__name__}: {error}',
                         'Give a log in a format and with a suffix python-can reads.')
        with reader:
            messages, path = self._messages(reader), Path(self.path)
            is_text = isinstance(reader, CanutilsLogReader) or path.suffix.lower() in TEXT_SUFFIXES
            is_cut = is_text and _ends_within_a_line(path)
            whole = self._without_last_line(messages) if is_cut else messages
            yield from self._counted(without_strays(filter(self._chosen.takes, whole), self._stray))
        if not is_cut and not self.unread and (shortfall := _shortfall(reader, Path(self.path))):
            self._unread(shortfall)
        if not self.can_frames and self._chosen.others:
            self._refuse(f'none of channel {self._channel!r}, but of {", ".join(sorted(self._chosen.others))}',
                         'Name one of these.')
        if not self.can_frames:
            self._refuse(f'none{f" ({self.unread} lines unread: {self.problem})" if self.unread else ""}',
                         'Record it again, or check that the suffix fits the content.')

    @property
    def summary(self) -> str:
        """What was read, as a sentence for the end of the log."""
        end = datetime.fromtimestamp(self._last, timezone.utc).isoformat(' ', 'milliseconds').replace('+00:00', ' UTC')
        rest = f'; {self.unread} lines or rests unread: {self.problem}' if self.unread else ''
        return f'{self.can_frames} CAN frames, the last at {end}{rest}.'

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
            if last is not None:
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

    def _refuse(self, got: str, remedy: str) -> NoReturn:
        raise LogError(self.path, expected='a log with CAN frames', got=got, remedy=remedy)
