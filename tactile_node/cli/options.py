"""Types of options that several sub-commands share; each raises ConfigurationError for what it cannot read."""

from tactile_node.cia301.node_id import MAX_NODE_ID, MIN_NODE_ID
from tactile_node.errors import ConfigurationError


def node_ids(text: str) -> list[int]:
    """'32,0x40' -> [32, 64]; with ``action='extend'`` the option may also be repeated."""
    try:
        numbers = [int(part, 0) for part in text.split(',')]
    except ValueError:
        numbers = []
    if not numbers or not all(MIN_NODE_ID <= number <= MAX_NODE_ID for number in numbers):
        raise ConfigurationError('--node-id', expected=f'whole numbers {MIN_NODE_ID}..{MAX_NODE_ID}, comma-separated',
                                 got=repr(text), remedy='For example --node-id 32,64.')
    return numbers


def names(text: str) -> list[str]:
    """'left,right' -> ['left', 'right']."""
    return [part.strip() for part in text.split(',') if part.strip()]


def pace(text: str) -> float:
    """Speed of a replay: 1 = as recorded, 0 = as fast as possible."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < float('inf'):
        raise ConfigurationError('--pace', expected='a number >= 0', got=repr(text),
                                 remedy='1 is the recorded pace, 0 as fast as possible.')
    return value
