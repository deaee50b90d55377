"""Names of the codes in our messages, for people: read from the definitions, so that no ROS is needed."""

import re
from collections.abc import Mapping
from functools import cache

from tactile_node.package_files import package_file

ENTRY = re.compile(r'^[\w/]+\S* +(\w+) *(?:= *(\d+))?', re.MULTILINE)


def name_of(interface: str | type, field: str, code: int) -> str:
    """Return the constant that ``code`` in ``field`` stands for, or the number as text where there is none.

    ``interface``: a class of ROS, such as Grasp or CheckGrasp.Response, or 'msg/Grasp'. Raises KeyError for a field
    without constants.

    >>> name_of('msg/Grasp', 'contact', 4)
    'TWO_SIDED'
    """
    if isinstance(interface, type):
        interface = f'{interface.__module__.split(".")[1]}/{interface.__name__.split("_")[0]}'
    return codes_of(interface)[field].get(code, str(code))


@cache
def codes_of(interface: str) -> Mapping[str, Mapping[int, str]]:
    """Return the names by code, by field: the constants that stand before a field are its codes."""
    definition = package_file(f'{interface}.{interface.split("/")[0]}').read_text(encoding='utf-8')
    codes: dict[str, dict[int, str]] = {}
    group: dict[int, str] = {}
    for name, number in ENTRY.findall(definition):
        if number:
            group[int(number)] = name
        elif group:
            codes[name], group = group, {}
    return codes
