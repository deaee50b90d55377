"""About how many CAN frames or messages a recording has: for the progress of what reads them all."""

import gzip
import zlib
from pathlib import Path

from tactile_node.recording.bag_records import is_bag, library
from tactile_node.recording.log_lines import READERS

CHUNK = 1 << 20  # bytes


def message_count(path: str | Path) -> int | None:
    """Return the lines of a text log or the messages of an .mcap that was ended; None where it is not known quickly."""
    path = Path(path)
    try:
        if is_bag(path):
            return _of_mcap(path) if path.suffix == '.mcap' else None
        name = Path(path.name.lower().removesuffix('.gz'))
        return _lines(path) if name.suffix in READERS else None
    except (OSError, EOFError, zlib.error):  # who reads it reports it
        return None


def _lines(path: Path) -> int:
    with gzip.open(path) if path.suffix == '.gz' else open(path, 'rb') as stream:
        return sum(chunk.count(b'\n') for chunk in iter(lambda: stream.read(CHUNK), b''))


def _of_mcap(path: Path) -> int | None:
    reader = library('mcap.reader', path)
    try:
        with path.open('rb') as file:
            summary = reader.make_reader(file).get_summary()
    except Exception:  # the library lets others' errors through; a file without its end has no count
        return None
    return None if summary is None or summary.statistics is None else summary.statistics.message_count
