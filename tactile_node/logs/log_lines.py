"""The lines of a text log: which hold a CAN frame, which something else, and which are damaged.

python-can's readers leave out lines that they do not understand, and take what they can of a damaged one.
"""

import re
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator
from typing import NamedTuple, TextIO

import can
from can.io import ASCReader, CanutilsLogReader, CSVReader, TRCReader

from tactile_node.assembly.router import non_data_kind


class TwoBuses(NamedTuple):
    """CAN frames that the pads' taxels need were on two buses."""

    can_id: int  #: of the frame on the second
    channels: tuple[str, ...]


class ChosenChannel:
    """Takes the frames of ``channel``, and those sent without a name where it is the log's first bus; '' is all."""

    def __init__(self, channel: str):
        self._channel = channel
        self._received: list[str] = []  # channels
        self.others: set[str] = set()  #: channels with frames that were not taken

    def takes(self, message: can.Message) -> bool:
        channel = str(message.channel)
        if not self._channel or channel == self._channel:
            return True
        if message.is_rx and channel not in self._received:
            self._received.append(channel)
        is_nameless = not message.is_rx and channel not in self._received
        if is_nameless and self._received[:1] in ([], [self._channel]):
            return True
        self.others.add(channel)
        return False


class OneBus:
    """Watches that CAN frames with one of ``can_ids`` come from one bus."""

    def __init__(self, can_ids: Collection[int]):
        self._can_ids = frozenset(can_ids)
        self._received: set[str] = set()  # channels
        self._used: dict[str, int] = {}  # channels of can_ids, each with its first

    def feed(self, message: can.Message) -> TwoBuses | None:
        """Take the next frame of the log; return the fault where it is of a second bus."""
        channel = str(message.channel)
        is_known = channel in self._received or not message.is_rx
        if not is_known:
            self._received.add(channel)
        is_counted = (channel in self._used or message.arbitration_id not in self._can_ids
                      or non_data_kind(message) is not None)
        if is_known and is_counted:
            return None
        if not is_counted:
            self._used[channel] = message.arbitration_id
        buses = [used for used in self._used if used in self._received] or list(self._used)
        return TwoBuses(self._used[buses[-1]], tuple(buses)) if len(buses) > 1 else None


#: of text, by suffix
READERS: dict[str, type] = {'.log': CanutilsLogReader, '.asc': ASCReader, '.trc': TRCReader, '.csv': CSVReader}
MOST_BYTES = 8  #: of a classic CAN frame


class _Format(NamedTuple):
    frame: str  #: a line with a CAN frame, as far as the reader does not check it
    other: str  #: a line without one
    restart: tuple[str, ...] = ()  #: what the reader takes for its header when it begins again


_NOTHING = r'\s*'
_ASC = (r'\s*[\d.]+\s+(CANFD\s.*|\d+\s+(ErrorFrame.*|\w+\s+(Rx|Tx|TxRq)\s+(r.*|d\s+\w+(\s+{byte})*'
        r'(\s+Length\s.*)?)))\s*')
_DECIMAL = re.compile(_ASC.format(byte=r'\d{1,3}'), re.IGNORECASE)  # where the header says "base dec"
_FORMATS: dict[type, _Format] = {
    CanutilsLogReader: _Format(r'\s*\(\d+\.\d+\)\s+\S+\s+([0-9A-F]{3}|[0-9A-F]{8})#'
                               r'(R\d?|([0-9A-F]{2}){0,8}|#[0-9A-F]([0-9A-F]{2}){0,64})(\s+[RT])?\s*', _NOTHING),
    CSVReader: _Format(r'[-+.\de]+,0x[0-9A-F]+,[01],[01],[01],\d+,[A-Z0-9+/]*={0,2}\s*',
                       r'timestamp,arbitration_id,.*\s*', ('timestamp\n',)),
    #: others: header, comments; events have no channel's number after the stamp, or name what they are after it
    ASCReader: _Format(_ASC.format(byte='[0-9A-F]{2}'), r'\s*(//.*|date\s.*|base\s.*|(no\s+)?internal events logged|'
                       r'(Begin|End) Trigger ?block.*|\d+\.\d+\s+((?!CANFD)[A-Z]\w*\b.*|'
                       r'\d+\s+(Statistic:|J1939TP|\w+\s+J1939).*))?\s*', ('\n',)),
    #: others: comments; warnings, errors and states of the bus
    TRCReader: _Format(r'\s*\d+(\)\s+[\d.]+\s+((\d+\s+)?(Rx|Tx)\s+)?[0-9A-F]{3,8}\s+(-\s+)?\d+'
                       r'(\s+RTR|(\s+[0-9A-F]{2})*)|\s+[\d.]+\s+[A-Z]{2}\s.*)\s*',
                       r'\s*(;.*|\d+\)?\s+\d+\.?\d*\s+(\d+\s+)?(Warng|Error|ST|EC|ER|EV|FFFFFFFF)\b.*)?\s*')}
_PATTERNS = {reader: (re.compile(form.frame, re.IGNORECASE), re.compile(form.other, re.IGNORECASE))
             for reader, form in _FORMATS.items()}


class LogLines:
    """Gives the lines of ``stream`` to a python-can ``reader`` (one of READERS) and watches what becomes of each."""

    def __init__(self, stream: TextIO, reader: type):
        self._stream = stream
        self._frame, self._other = _PATTERNS[reader]
        self._restart = _FORMATS[reader].restart
        self._before: list[str] = []  # to be given before the next line
        self._given: list[str] = []  # not judged yet

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        if self._before:
            return self._before.pop(0)
        line = next(self._stream)
        self._given.append(line)
        return line

    def close(self) -> None:
        self._stream.close()

    def read_by(self, reader: Iterable[can.Message], on_unread: Callable[[str], None]) -> Iterator[can.Message]:
        """Give the messages of whole lines; ``on_unread`` gets the reason for each line left out.

        Raises what reading the file raises, EOFError, OSError or zlib.error, and the reader's own error where it is of
        no line, as over a header, or where an ASC file does not say when it begins: without that, no stamp is right.
        """
        while True:
            try:
                for message in reader:
                    line = self._given.pop()
                    self._judge(on_unread)
                    frame = _DECIMAL if getattr(reader, 'base', '') == 'dec' else self._frame
                    if frame.fullmatch(line) is not None and _is_whole(line, message):
                        yield message
                    else:
                        on_unread(_problem(line))
                self._judge(on_unread)
                return
            except (EOFError, OSError, zlib.error):
                self._judge(on_unread)
                raise
            except Exception as error:  # over a bad line: ValueError, IndexError, KeyError...
                has_line = bool(self._given)
                line = self._given.pop() if has_line else ''
                self._judge(on_unread)
                if not has_line or (isinstance(reader, ASCReader) and not reader.start_time):
                    raise
                on_unread(_problem(line, f'{type(error).__name__}: {error}'))
                self._before = list(self._restart)

    def _judge(self, on_unread: Callable[[str], None]) -> None:
        """Report the lines given of which came no frame, unless they are known to hold none."""
        given, self._given = self._given, []
        for line in given:
            if self._other.fullmatch(line) is None:
                on_unread(_problem(line))


def _is_whole(line: str, message: can.Message) -> bool:
    has_data = not (message.is_remote_frame or message.is_error_frame)
    return (line.endswith('\n') and (message.is_fd or message.dlc <= MOST_BYTES)
            and not (has_data and len(message.data) != message.dlc))


def _problem(line: str, problem: str = 'a damaged line') -> str:
    """A line without its end is cut short: what is left of it may read as another frame."""
    is_whole = line.endswith('\n') or not line
    return problem if is_whole else 'cut short: it ends within a line, of which nothing is used'
