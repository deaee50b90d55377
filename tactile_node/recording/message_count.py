"""About how many CAN frames or messages a recording has: for the progress of what reads them all."""

import gzip
import zlib
from collections.abc import Collection
from pathlib import Path

from tactile_node.errors import LogError
from tactile_node.recording.bag_records import is_bag, opened_mcap
from tactile_node.recording.log_lines import READERS
from tactile_node.recording.series import files_of

CHUNK = 1 << 20  # bytes


def message_count(path: str | Path, types: Collection[str]) -> int | None:
    """Return the lines of a text log, or the messages of ``types`` in a bag of .mcap files; None where it is not known.

    What is wrong with a file is left to who reads it.
    """
    path = Path(path)
    try:
        if is_bag(path):
            return sum(_of_mcap(file, types) for file in files_of(path))
        name = Path(path.name.lower().removesuffix('.gz'))
        return sum(map(_lines, files_of(path))) if name.suffix in READERS else None
    except (OSError, EOFError, zlib.error, LogError):
        return None


def _lines(path: Path) -> int:
    with gzip.open(path) if path.suffix == '.gz' else open(path, 'rb') as stream:
        return sum(chunk.count(b'\n') for chunk in iter(lambda: stream.read(CHUNK), b''))


def _of_mcap(path: Path, types: Collection[str]) -> int:
    """Raises EOFError for a file that has no counts: it was not ended, or is no .mcap."""
    with opened_mcap(path) as file:
        if file.summary is None or file.summary.statistics is None:
            raise EOFError(f'{path} has no counts')
        counts = file.summary.statistics.channel_message_counts
        return sum(counts.get(channel.id, 0) for channel, schema in file.channels
                   if schema is not None and schema.name in types)
