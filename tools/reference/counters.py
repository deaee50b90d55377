"""Generate the tables of the driver's counters from `tactile_node/assembly/facts.py`."""

from reference import markdown as md
from tactile_node.assembly.facts import LOST, BusFacts, LossReason, NodeFacts, PadFacts, meanings


def markdown() -> str:
    losses = {f'{LOST}{reason.key}': reason.phrase for reason in LossReason}
    parts = {'Bus': meanings(BusFacts), 'Pad': meanings(PadFacts) | losses, 'Node': meanings(NodeFacts)}
    return '\n\n'.join(f'## {part}\n\n{_table(rows)}' for part, rows in parts.items())


def _table(rows: dict[str, str]) -> str:
    return md.table(('counter', 'meaning'), ((md.code(name), md.prose(meaning)) for name, meaning in rows.items()))
