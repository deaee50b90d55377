"""Where one value is in an object dictionary: index and sub-index, as people write them."""

import re
from dataclasses import dataclass

from tactile_node.cia301.objects import MAX_INDEX, MAX_SUBINDEX

FIRST_INDEX = 0x1000  #: below are data types (CiA 301, 7.4.1), which no SDO server has
_ADDRESS = re.compile(r'(0x[0-9a-f]+|[0-9]{5,})(?::(0x[0-9a-f]+|[0-9]+))?', re.IGNORECASE)


@dataclass(frozen=True)
class ObjectAddress:
    """One value of a device; ``sub`` is 0 for an object without sub-indices."""

    index: int
    sub: int

    def __str__(self) -> str:
        return f'0x{self.index:04X} sub {self.sub}'


def parse_address(written: str) -> ObjectAddress:
    """Return the address that '0x1018:1', '0x1018:0x01' or '25601:16' stands for; ValueError for anything else.

    Manuals write an index as four hexadecimal digits, so four digits without 0x could be either:

    >>> parse_address('0x6401:16'), parse_address('25601:0x10')
    (ObjectAddress(index=25601, sub=16), ObjectAddress(index=25601, sub=16))
    >>> parse_address('6401')
    Traceback (most recent call last):
    ValueError: 6401
    """
    match = _ADDRESS.fullmatch(written.strip())
    if match is None:
        raise ValueError(written)
    address = ObjectAddress(int(match[1], 0), int(match[2] or '0', 0))
    if not (FIRST_INDEX <= address.index <= MAX_INDEX and address.sub <= MAX_SUBINDEX):
        raise ValueError(written)
    return address
