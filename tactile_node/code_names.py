"""Names of the codes in our messages: the constants that stand before a field in its definition. Needs no ROS."""

import re

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
    names: dict[int, str] = {}
    for name, number in ENTRY.findall(package_file(f'{interface}.{interface.split("/")[0]}').read_text('utf-8')):
        if number:
            names[int(number)] = name
        elif name == field and names:
            return names.get(code, str(code))
        else:
            names = {}
    raise KeyError(field)
