"""Describe codes in words: enumerations with a phrase for each member, and the names of codes in our ROS messages.

This module works without ROS.
"""

import re
from enum import Enum

from tactile_node.package_files import package_file


class PhrasedCode(Enum):
    """A stable number with a phrase that states its meaning.

    The phrase is part of a sentence and has no full stop.
    """

    phrase: str

    def __new__(cls, code: int, phrase: str) -> 'PhrasedCode':
        member = object.__new__(cls)
        member._value_ = code
        member.phrase = phrase
        return member

    @property
    def key(self) -> str:
        """Name of the code in diagnostics, files and summaries, such as 'out_of_order'."""
        return self.name.lower()


ENTRY = re.compile(r'^[\w/]+\S* +(\w+) *(?:= *(\d+))?', re.MULTILINE)


def name_of(interface: str | type, field: str, code: int) -> str:
    """Return the name of the constant for a code, or the number as text if there is no such constant.

    Parameters
    ----------
    interface : str or type
        A ROS class, such as Grasp or CheckGrasp.Response, or an interface name, such as 'msg/Grasp'.
    field : str
        Field of the message that holds the code.
    code : int
        Value of the field.

    Raises
    ------
    KeyError
        Raised if the field has no constants.

    Examples
    --------
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
