"""COB-IDs as EDS and layout files write them, and their flags."""

import re
from typing import NamedTuple

DISABLED = 1 << 31  #: "PDO does not exist" in sub 1 of the PDO communication record (CiA 301)
NO_RTR = 1 << 30  #: "no remote request allowed", same place
PRODUCES_SYNC = 1 << 30  #: in 0x1005: the device produces SYNC
SYNC_ID_MASK = (1 << 30) - 1  #: in 0x1005: the identifier and bit 29, which says that it has 29 bits
ID_MASK = 0x7FF  #: the identifier, also its greatest value: 11 bits

_TERM = re.compile(r'\$NODEID|0X[0-9A-F]+|[0-9]+')


class CobId(NamedTuple):
    """An 11-bit COB-ID, given as a number or as '$NODEID+0x180' (CiA 306)."""

    base: int
    relative: bool  #: the node-ID is added

    def of(self, node_id: int) -> int:
        return self.base + (node_id if self.relative else 0)

    def __str__(self) -> str:
        return f'{"$NODEID+" if self.relative else ""}0x{self.base:03X}'


def parse_cob_id(written: int | str) -> CobId:
    """Return the COB-ID of a number, '0x1A0', '$NODEID+0x180' or '0x180 + $NodeID'; ValueError otherwise.

    >>> parse_cob_id('$NODEID+0x180').of(32) == 0x1A0
    True
    """
    if isinstance(written, bool) or not isinstance(written, (int, str)):
        raise ValueError(written)
    terms = str(written).replace(' ', '').upper().split('+')
    if not all(_TERM.fullmatch(term) for term in terms) or terms.count('$NODEID') > 1:
        raise ValueError(written)
    base = sum(int(term, 0) for term in terms if term != '$NODEID')
    if not 0 <= base <= ID_MASK:
        raise ValueError(written)
    return CobId(base, '$NODEID' in terms)
