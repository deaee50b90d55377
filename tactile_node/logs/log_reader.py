"""Read CAN logs: text logs, other formats of python-can such as .blf, and ROS 2 bags."""

import gzip
import logging
import re
import zlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NoReturn

import can
from can.io.generic import MessageReader

from tactile_node.errors import LogError
from tactile_node.logs import text_formats
from tactile_node.logs.bag_log import read_can_frames
from tactile_node.logs.bag_records import OnDamage, is_bag, open_sqlite
from tactile_node.logs.blf_objects import BlfReader
from tactile_node.logs.damage import Damage, DamageKind, damage_text, utc
from tactile_node.logs.log_lines import ChosenChannel
from tactile_node.logs.replay_times import WHOLE, TimeWindow
from tactile_node.logs.series import parts_of

logger = logging.getLogger(__name__)

#: output of `candump -L`
CANDUMP = re.compile(rb'\(\d+\.\d+\) \S+ [0-9A-Fa-f]{3,8}#')
#: output of `candump can0`
CONSOLE = re.compile(rb'\s*(\([\d. :-]+\)\s+)?\S+\s+[0-9A-Fa-f]{3,8}\s+\[\d+\]')
#: backward step of the stamps above which a frame is out of order [s]; frames stamped by one clock differ by less
SET_BACK = 1.0
#: forward step of the stamps above which a stamp is suspicious [s]; a working skin never pauses for this long
FAR_AHEAD = 10.0


def _reader(path: str, on_unread: Callable[[str], None], on_damage: OnDamage) -> MessageReader:
    """Return a python-can reader that receives only complete lines of a text log or intact objects of a .blf file."""
    with open(path, 'rb') as file:
        opened = gzip.open if file.read(2) == b'\x1f\x8b' else open
    with opened(path, 'rb') as stream:
        try:
            head = stream.read(4096)
        except (EOFError, OSError, zlib.error):  # reading the whole file will report the damage
            head = b''
    if CONSOLE.match(head):
        raise LogError(path, expected='a log with the stamps of its CAN frames',
                       got='text in the format that candump prints on a terminal',
                       remedy='Record with `tactile record`, or with candump -L.')
    suffix = Path(path.lower().removesuffix('.gz')).suffix
    form = text_formats.CANDUMP if CANDUMP.match(head) else text_formats.FORMATS.get(suffix)
    if form is not None:
        text = opened(path, 'rt', encoding='utf-8', errors='replace')  # an invalid byte then affects only its line
        reader: Any = form.reader(text)
        reader.file = text_formats.whole_lines(text, form, on_unread)
        return reader
    if suffix == '.blf':
        content: Any = opened(path, 'rb')
        return BlfReader(content, Path(path).name, on_damage)
    if suffix == '.db':
        return _SqliteReader(path)
    logger.warning('%s is read by python-can, which skips parts that it cannot parse, and does not count '
                   'them.', path)
    return can.LogReader(path)


class _SqliteReader(can.SqliteReader):
    """python-can's SQLite reader, with a connection that any thread may use."""

    def __init__(self, path: str):
        super().__init__(path)
        self._conn.close()
        self._conn = open_sqlite(Path(path))
        self._cursor = self._conn.cursor()


class CanLogReader:
    """Iterates over the CAN messages of a log.

    Parameters
    ----------
    path
        Path of the log or bag. Given the first file of a rotated series, the reader reads the whole series.
    channel
        Name of the bus to read from a log of several buses, or the topic in a bag. '' reads all buses.
    window
        Part of the recording to read. In a bag, messages before this part are skipped without being read.

    Attributes
    ----------
    unread
        Number of unreadable lines or parts.
    problem
        Reason why the last unread line or part could not be read.
    damages
        Missing parts of a bag, a .blf file or a series, with the time at which they were recorded.
    can_frames
        Number of CAN frames read so far.

    Raises
    ------
    LogError
        Raised if the file is missing, has an unknown format or contains no CAN frame.

    Notes
    -----
    A CAN frame is dropped and counted as unread if its stamp is far from those of its neighbours. If a full disk or an
    incomplete download cut the log short, the intact part is read, and ``summary`` reports where it ends.
    """

    def __init__(self, path: str | Path, channel: str = '', window: TimeWindow = WHOLE):
        self.path = str(path)
        self._channel = channel
        self._window = window
        self.unread = 0
        self.problem = ''
        self.damages: list[Damage] = []
        self.can_frames = 0
        self._last = 0.0  # stamp
        self._chosen = ChosenChannel(channel)
        if not Path(path).is_file() and not (Path(path).is_dir() and is_bag(path)):
            self._refuse('a path that is not a file' if Path(path).exists() else 'no such file', 'Check the path.')

    def __iter__(self) -> Iterator[can.Message]:
        self.unread = 0
        self.damages = []
        self.can_frames = 0
        self._chosen = ChosenChannel(self._channel)
        is_of_bag = is_bag(self.path)
        messages = self._of_bag() if is_of_bag else self._of_parts()
        messages = without_strays(filter(self._chosen.takes, messages), lambda message: self._unread(
            f'a stamp of {message.timestamp:.6f} s, far from its neighbours'))
        for message in messages if is_of_bag or self._window == WHOLE else self._within(messages):
            self.can_frames += 1
            self._last = message.timestamp
            yield message
        if not self.can_frames and self._chosen.others:
            self._refuse(f'none of channel {self._channel!r}, but of {", ".join(sorted(self._chosen.others))}',
                         'Name one of these.')
        if not self.can_frames:
            self._refuse(f'none{f" ({self.unread} lines unread: {self.problem})" if self.unread else ""}',
                         'Record it again, or check that the suffix fits the content.' if self._window == WHOLE
                         else 'Check --start and --duration.')

    @property
    def summary(self) -> str:
        """Sentence with the number of frames read, the last stamp and the unread parts."""
        rest = f'; {self.unread} lines or parts unread: {self.problem}' if self.unread else ''
        return f'{self.can_frames} CAN frames, the last at {utc(self._last)}{rest}.'

    def _of_bag(self) -> Iterator[can.Message]:
        try:
            yield from read_can_frames(self.path, self._damaged, self._window)
        except OSError as error:
            self._unread(error)

    def _within(self, messages: Iterator[can.Message]) -> Iterator[can.Message]:
        """Yield the messages in the window. Earlier messages must be read too, because text logs have no index."""
        begin: float | None = None
        for message in messages:
            begin = message.timestamp if begin is None else begin
            since = message.timestamp - begin
            if since >= self._window.end:
                return
            if since >= self._window.start:
                yield message

    def _of_parts(self) -> Iterator[can.Message]:
        last: float | None = None
        missing: list[Damage] = []
        for part in parts_of(self.path):
            if not part.is_there:
                missing.append(Damage(DamageKind.MISSING_FILE, part.path.name, begin=last))
                continue
            for message in self._of_file(part.path):
                for damage in missing:
                    self._damaged(damage._replace(end=message.timestamp))
                missing, last = [], message.timestamp
                yield message
        for damage in missing:
            self._damaged(damage)

    def _of_file(self, path: Path) -> Iterator[can.Message]:
        try:
            reader = _reader(str(path), self._unread, lambda damage: self._damaged(
                damage._replace(begin=self._last or None)))
        except LogError:
            raise
        except Exception as error:  # each python-can reader raises different errors for a bad header
            if path != Path(self.path):  # the other files of the series can still be read
                self._unread(error)
                return
            self._refuse(f'{type(error).__name__}: {error}',
                         'Give a log in a format that python-can reads, with the suffix of that format.')
        try:
            with reader:
                yield from reader
        except Exception as error:  # each reader raises different errors for a truncated or damaged .gz
            self._unread(error)

    def _damaged(self, damage: Damage) -> None:
        self.damages.append(damage)
        self._unread(damage_text(damage))

    def _unread(self, problem: Exception | str) -> None:
        self.unread += 1
        self.problem = problem if isinstance(problem, str) else f'{type(problem).__name__}: {problem}'

    def _refuse(self, got: str, remedy: str) -> NoReturn:
        raise LogError(self.path, expected='a log with CAN frames', got=got, remedy=remedy)


def without_strays(messages: Iterable[can.Message], on_stray: Callable[[can.Message], None]) -> Iterator[can.Message]:
    """Drop each isolated CAN frame with a wrong stamp.

    A stamp is wrong if it is more than FAR_AHEAD later or more than SET_BACK earlier than the stamps of its neighbours.
    If the next frame continues from the new time, the frame is kept, because the clock was set or the bus was idle.

    Parameters
    ----------
    messages
        Messages in log order.
    on_stray
        Called with each dropped message.

    Examples
    --------
    >>> def log(*stamps):
    ...     return [can.Message(stamp) for stamp in stamps]
    >>> strays = []
    >>> [m.timestamp for m in without_strays(log(7000, 1, 2, 9000, 3, 4, 5000, 5001, 40, 41), strays.append)]
    [1, 2, 3, 4, 5000, 5001, 40, 41]
    >>> [m.timestamp for m in strays]
    [7000, 9000]
    """
    last = message = None
    for following in messages:
        if message is not None:
            if _is_stray(last, message.timestamp, following.timestamp):
                on_stray(message)
            else:
                last = message.timestamp
                yield message
        message = following
    if message is not None:
        yield message


def _is_stray(last: float | None, stamp: float, following: float) -> bool:
    if last is None:
        return following < stamp - SET_BACK
    return not _fits(stamp, last) and _fits(following, last)


def _fits(stamp: float, last: float) -> bool:
    return last - SET_BACK <= stamp <= last + FAR_AHEAD
