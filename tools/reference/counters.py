"""Generate the tables of the driver's counters from `tactile_node/assembly/counters.py`."""

from collections.abc import Iterable, Iterator

from reference import markdown as md
from tactile_node.assembly import counters
from tactile_node.assembly.frame_source import LossReason


def markdown() -> str:
    losses = ((f'tpdos_lost_{reason.key}', reason.phrase) for reason in LossReason)
    parts = {'Bus': listed((*counters.BUS_LOSSES, *counters.BUS_EVENTS)),
             'Pad': (*listed(counters.PAD_COUNTERS), *losses), 'Node': listed(counters.NODE_COUNTERS)}
    return '\n\n'.join(f'## {part}\n\n{_table(rows)}' for part, rows in parts.items())


def listed(rows: Iterable[counters.Counter]) -> Iterator[tuple[str, str]]:
    """Yield the name and the meaning of each counter."""
    return ((row.name, row.meaning) for row in rows)


def _table(rows: Iterable[tuple[str, str]]) -> str:
    return md.table(('counter', 'meaning'), ((md.code(name), md.prose(meaning)) for name, meaning in rows))
