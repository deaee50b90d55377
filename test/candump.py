"""Parser for candump text that shares no code with the package, so that tests do not rely on the reader under test."""

import gzip
from pathlib import Path
from typing import NamedTuple

DATA = Path(__file__).parent / 'data'


class Line(NamedTuple):
    stamp: float
    can_id: int
    data: bytes


def read_candump(name: str) -> list[Line]:
    """Return the lines of a log, for example '(1.5) can0 080#0102 R' as Line(1.5, 0x80, b'\\x01\\x02')."""
    lines = gzip.open(DATA / name, 'rt', encoding='ascii').read().splitlines()
    return [_line(*line.split()[::2][:2]) for line in lines]


def _line(stamp: str, frame: str) -> Line:
    can_id, data = frame.split('#')
    return Line(float(stamp.strip('()')), int(can_id, 16), bytes.fromhex(data))
