"""Text log formats of candump and python-can, and a filter that drops damaged lines."""

import re
from collections.abc import Callable, Iterator
from functools import partial
from io import StringIO
from typing import NamedTuple, TextIO

import can
from can.io import CanutilsLogReader
from can.io.generic import MessageReader
from can.util import dlc2len


class TextFormat(NamedTuple):
    """Line patterns of a text log format."""

    reader: Callable[[TextIO], MessageReader]  #: reader of python-can
    frame: re.Pattern[str]  #: line with a complete CAN frame, or line that changes the time of the following frames
    other: re.Pattern[str]  #: start of a line without a CAN frame, such as a comment, a statistic or an event
    header: re.Pattern[str] = re.compile('(?!)')  #: start of a header line, which the reader needs before the frames
    header_end: str = ''    #: line at which the reader stops looking for the header; the reader drops this line
    corrected: Callable[[str], str] = str  #: function that makes a line readable, or raises ValueError


def whole_lines(stream: TextIO, form: TextFormat, on_unread: Callable[[str], None]) -> Iterator[str]:
    """Yield the lines that the reader of the format needs.

    Damaged lines are dropped, because the readers of python-can would stop at a damaged line, skip it or use a part of
    it.

    Parameters
    ----------
    stream
        Log.
    form
        Format of the log.
    on_unread
        Called with the reason for each dropped line.
    """
    is_header = True
    with stream:
        for line in stream:
            try:
                readable = form.corrected(line)
            except ValueError as error:
                on_unread(str(error))
                continue
            if form is ASC and _DECIMAL.match(line):
                form = ASC_DECIMAL
            if form.header.match(line):
                yield readable
            elif form.frame.fullmatch(line):
                if is_header and form.header_end:
                    yield form.header_end
                is_header = False
                yield readable
            elif not form.other.match(line):  # a truncated line may look like a different frame
                on_unread(f'a damaged line: {line.strip()[:MOST_SHOWN]!r}' if line.endswith('\n')
                          else 'cut short: the log ends within a line, and that line is not used')


MOST_SHOWN = 60  #: maximum number of characters reported from a damaged line
DLCS = range(16)
MOST_DATA = 64  #: maximum data size of a CAN FD frame [bytes]


def _pattern(text: str) -> re.Pattern[str]:
    return re.compile(text, re.IGNORECASE)


CANDUMP = TextFormat(
    CanutilsLogReader, _pattern(r'\s*\(\d+\.\d+\)\s+\S+\s+([0-9A-F]{3}|[0-9A-F]{8})#'
                                r'(R[0-8]?|([0-9A-F]{2}){0,8}|#[0-9A-F]([0-9A-F]{2}){0,64})(\s+[RT])?\s*\n'),
    _pattern(r'\s*$'))

_DATE = _pattern(r'(?P<what>date|begin\s+triggerblock)\s+(?P<date>\S.*\n)')
_HOUR_OF_DAY = _pattern(r'(?<=\s)((?:00|1[3-9]|2[0-3]):\d\d:\S+)\s+[ap]m\b')


def _with_readable_date(line: str) -> str:
    """Return a line of an ASC log after rewriting any date for python-can. Raises ValueError for an unreadable date."""
    found = _DATE.fullmatch(line)
    if found is None:
        return line
    # the German month Mär in a Windows encoding
    date = _HOUR_OF_DAY.sub(r'\1', found['date'].replace('M\ufffdr', 'Mar'))
    reader = can.ASCReader(StringIO(f'date {date}'), relative_timestamp=False)
    next(iter(reader), None)
    if reader.date is None:
        raise ValueError(f'an unreadable date: {line.strip()[:MOST_SHOWN]!r}')
    return f'{found["what"]} {date}'


def _asc(can_id: str, byte: str) -> TextFormat:
    """Return the format of ASC logs in which identifiers and bytes match these patterns."""
    classic = '|'.join(rf'{dlc:x}(?:\s+{byte}){{{min(dlc, 8)}}}(?!\s+{byte}\s)' for dlc in DLCS)
    fd = '|'.join(rf'{dlc:x}\s+(?:0|{dlc2len(dlc)}(?:\s+{byte}){{{dlc2len(dlc)}}})' for dlc in DLCS)
    way = r'\s+(?:Rx|Tx|TxRq)\s+'
    return TextFormat(
        partial(can.ASCReader, relative_timestamp=False),
        # No decimal point may follow the frame, because two lines that have run together contain a second stamp with a
        # decimal point.
        _pattern(rf'\s*\d+\.\d+\s+(?:\d+\s+{can_id}x?{way}(?:r|d\s+(?:{classic}))|CANFD\s+\d+{way}'
                 rf'{can_id}x?\s+(?:\S+\s+)?[01]\s+[01]\s+(?:{fd}))\s[^.]*|'
                 rf'\s*\d+\.\d+\s+(?:CANFD\s+)?\d+(?:{way}|\s+)ErrorFrame\s.*\n?|begin\s+triggerblock\s+\S.*\n'),
        _pattern(r'\s*(?:$|//|(?:no\s+)?internal\s+events|(?:begin|end)\s+triggerblock\s*$|'
                 r'\d+\.\d+\s+(?:CANFD\s+)?(?:\d+\s+(?:Statistic|Status|OverloadFrame|J1939)|(?!CANFD)[A-Z]))'),
        _pattern(r'(?:date|base)\s'), 'internal events logged\n', _with_readable_date)


ASC = _asc('[0-9A-F]+', '[0-9A-F]{2}')
ASC_DECIMAL = _asc(r'\d+', r'\d{1,3}')
_DECIMAL = _pattern(r'base\s+dec\b')

#: DLC or length in a TRC column, paired with the number of data bytes in the frame
_TRC_SIZES = sorted({(dlc, dlc2len(dlc)) for dlc in DLCS} | {(dlc2len(dlc), dlc2len(dlc)) for dlc in DLCS})
_TRC_DATA = '|'.join(rf'{given}(?:\s+[0-9A-F]{{2}}){{{size}}}' for given, size in _TRC_SIZES)
_TRC_ID = r'[0-9A-F]{4,8}\s+(?:[RT]x\s+)?(?:-\s+)?'
TRC = TextFormat(
    can.TRCReader,
    _pattern(rf'\s*\d+\)?\s+\d+(?:\.\d+)?\s+(?:RR\s+(?:\d+\s+)?{_TRC_ID}\d+|'
             rf'(?:(?:\d+|[RT]x|DT|FD|FB|FE|BI)\s+){{0,2}}{_TRC_ID}(?:\d\s+RTR|{_TRC_DATA}))\s*'),
    _pattern(r'\s*(?:$|;|\d+\)?\s+[\d.]+\s+(?:\d+\s+)?(?:Warng|Error|Event|FFFFFFFF|ST|EC|ER|EV)\s)'),
    _pattern(r';\$'))

#: patterns for a number of bytes and for their base64 code
_CSV_DATA = '|'.join(rf'{size},[A-Z0-9+/]{{{(size * 4 + 2) // 3}}}={{{-size % 3}}}' for size in range(MOST_DATA + 1))
CSV = TextFormat(
    can.CSVReader, _pattern(rf'[\d.e+-]+,0x[0-9a-f]+,[01],(?:1,[01],\d+,|0,[01],(?:{_CSV_DATA}))\n?'),
    _pattern(r'timestamp,|\s*$'), header_end='timestamp\n')

#: formats by suffix
FORMATS = {'.log': CANDUMP, '.asc': ASC, '.trc': TRC, '.csv': CSV}
