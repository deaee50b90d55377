"""Read CAN logs: text logs, other formats of python-can such as .blf, and ROS 2 bags."""

import gzip
import logging
import re
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from operator import index
from pathlib import Path
from typing import Any, NoReturn

import can

from tactile_node.errors import LogError
from tactile_node.logs import text_formats
from tactile_node.logs.bag_decoder import CAN_TYPE, BagDecoder
from tactile_node.logs.bag_log import can_message
from tactile_node.logs.bag_records import is_bag, require_topic, topics_of
from tactile_node.logs.blf_objects import blf_messages
from tactile_node.logs.damage import Damage, DamageKind, damage_text, placed, utc
from tactile_node.logs.log_lines import ChosenChannel
from tactile_node.logs.replay_times import WHOLE, TimeWindow
from tactile_node.logs.series import parts_of
from tactile_node.logs.sqlite_file import open_sqlite

logger = logging.getLogger(__name__)

#: output of `candump -L`
CANDUMP = re.compile(rb'\(\d+\.\d+\) \S+ [0-9A-Fa-f]{3,8}#')
#: output of `candump can0`
CONSOLE = re.compile(rb'\s*(\([\d. :-]+\)\s+)?\S+\s+[0-9A-Fa-f]{3,8}\s+\[\d+\]')
#: backward step of the stamps above which a frame is out of order [s]; frames stamped by one clock differ by less
SET_BACK = 1.0
#: forward step of the stamps above which a stamp is suspicious [s]; a working skin never pauses for this long
FAR_AHEAD = 10.0
MOST_CLASSIC_DATA = 8  #: maximum data size of a CAN frame that is not CAN FD [bytes]


def _messages_of(path: Path, on_unread: Callable[[str], None]) -> Iterator[can.Message | Damage]:
    """Yield the CAN messages of a file, and a `Damage` for each damaged place of a .blf file.

    The function passes on the errors of python-can's readers. Each reader raises different errors.

    Parameters
    ----------
    path
        Path of the file.
    on_unread
        Called with the reason for each dropped line of a text log or row of a database.
    """
    with path.open('rb') as file:
        opened = gzip.open if file.read(2) == b'\x1f\x8b' else open
    with opened(path, 'rb') as stream:
        try:
            head = stream.read(4096)
        except (EOFError, OSError, zlib.error):  # reading the whole file will report the damage
            head = b''
    if CONSOLE.match(head):
        raise LogError(str(path), expected='a log with the stamps of its CAN frames',
                       got='text in the format that candump prints on a terminal',
                       remedy='Record with `tactile record`, or with candump -L.')
    suffix = Path(path.name.lower().removesuffix('.gz')).suffix
    form = text_formats.CANDUMP if CANDUMP.match(head) else text_formats.FORMATS.get(suffix)
    if form is not None:
        text = opened(path, 'rt', encoding='utf-8', errors='replace')  # an invalid byte then affects only its line
        reader: Any = form.reader(text)
        reader.file = text_formats.whole_lines(text, form, on_unread)
        with reader:
            yield from reader
    elif suffix == '.blf':
        content: Any = opened(path, 'rb')
        yield from blf_messages(content, path.name)
    elif suffix == '.db':
        yield from _of_database(path, on_unread)
    else:
        logger.warning('%s is read by python-can, which skips parts that it cannot parse, and does not count '
                       'them.', path)
        with can.LogReader(str(path)) as reader:
            yield from reader


def _of_database(path: Path, on_unread: Callable[[str], None]) -> Iterator[can.Message]:
    """Yield the CAN messages of python-can's SQLite format. python-can's reader serves only the thread that opened it.

    ``on_unread`` is called with the reason for each dropped row.
    """
    with closing(open_sqlite(path)) as base:
        for row in base.execute('SELECT ts, arbitration_id, extended, remote, error, dlc, data FROM messages'):
            stamp, can_id, is_extended, is_remote, is_error, dlc, data = row
            try:
                message = can.Message(
                    stamp, index(can_id), is_extended_id=bool(is_extended), is_remote_frame=bool(is_remote),
                    is_error_frame=bool(is_error), is_fd=index(dlc) > MOST_CLASSIC_DATA, dlc=index(dlc),
                    data=memoryview(data), check=True)
            except (TypeError, ValueError) as error:  # a damaged database may hold values of any type
                on_unread(f'a damaged row: {error}')
            else:
                yield message


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
    incomplete download cut the log short, the intact part is read, and ``summary`` reports the last stamp.
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
        messages = self._of_bag() if is_bag(self.path) else placed(
            self._of_files(), lambda message: message.timestamp, self._damaged)
        messages = without_strays(filter(self._chosen.takes, messages), lambda message: self._unread(
            f'a stamp of {message.timestamp:.6f} s, far from its neighbours'))
        for message in messages if is_bag(self.path) or self._window == WHOLE else self._within(messages):
            self.can_frames += 1
            self._last = message.timestamp
            yield message
        if not self.can_frames:
            self._refuse_without_frames()

    def _refuse_without_frames(self) -> NoReturn:
        if self._chosen.others:
            self._refuse(f'none of channel {self._channel!r}, but of {", ".join(sorted(self._chosen.others))}',
                         'Name one of these.')
        if is_bag(self.path) and (topics := topics_of(self.path)):
            require_topic(self.path, topics, CAN_TYPE,
                          'Record the topic of your CAN driver, such as /from_can_bus of ros2_socketcan.')
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
            yield from BagDecoder(self.path).messages((CAN_TYPE,), can_message, self._damaged, self._window)
        except OSError as error:
            self._unread(error)

    def _of_files(self) -> Iterator[can.Message | Damage]:
        for path in parts_of(self.path):
            if not path.is_file():
                yield Damage(DamageKind.MISSING_FILE, path.name)
                continue
            try:
                yield from _messages_of(path, self._unread)
            except LogError:
                raise
            except Exception as error:  # python-can raises different errors for each format and each damage
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
