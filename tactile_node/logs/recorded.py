"""A message of a ROS 2 bag as the recorder stored it."""

from typing import NamedTuple

MSG_ENCODING = 'ros2msg'  #: name of the encoding for message definitions written as in .msg files


class Recorded(NamedTuple):
    """One message of a bag."""

    topic: str
    type: str
    time: int  #: time of recording [ns]
    cdr: bytes
    definition: str = ''  #: .msg definitions of the type and its nested types, or '' if the bag has none
