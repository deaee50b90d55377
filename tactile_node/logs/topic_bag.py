"""Read this package's topics from a ROS 2 bag without ROS."""

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tactile_node.logs.bag_decoder import CAN_TYPE, PACKAGE, BagDecoder
from tactile_node.logs.bag_records import is_bag, require_topic, topics_of
from tactile_node.logs.damage import Damage, DamageKind, damage_text
from tactile_node.logs.recorded import Recorded
from tactile_node.logs.replay_times import SECOND, WHOLE, TimeWindow
from tactile_node.skin.taxel_array import Time, check_taxel_array
from tactile_node.taxel_frame import TaxelFrame, TpdoAges, read_only


def seconds(stamp: Time) -> float:
    return stamp.sec + stamp.nanosec / SECOND


def frame_of(message) -> TaxelFrame:
    """Convert a TaxelArray, which must have passed `check_taxel_array`, into a taxel frame."""
    grid = message.rows, message.cols
    ages = None
    if len(getattr(message, 'tpdo_ages', ())):
        ages = TpdoAges(_array(message.tpdo_ages, np.float32), _array(message.taxel_tpdos, np.uint16).reshape(grid))
    return TaxelFrame(stamp=seconds(message.header.stamp), sequence=message.sequence,
                      values=_array(message.values, np.float32).reshape(grid),
                      status=_array(message.status, np.uint8).reshape(grid),
                      missing_can_frames=message.missing_can_frames, tpdo_ages=ages)


def _array(values, dtype: type) -> np.ndarray:
    return read_only(np.array(values, dtype))


TAXELS = f'{PACKAGE}/msg/TaxelArray'
STATUS = f'{PACKAGE}/msg/SkinStatus'
GRASP = f'{PACKAGE}/msg/Grasp'
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'


class BagMessage(NamedTuple):
    """A decoded message. ``content`` has the fields of the message definition, with numbers in NumPy arrays."""

    topic: str
    type: str
    #: recording time [s, Unix epoch]
    recorded: float
    #: recording time on the clock of the taxel stamps, which differs from ``recorded`` in a replay or if the clocks of
    #: two computers differ
    stamp: float
    content: Any


def holds_taxels(path: str | Path) -> bool:
    """Return True if ``path`` is a bag with taxel arrays of this package. The bag may also contain CAN frames."""
    return is_bag(path) and TAXELS in topics_of(path).values()


def holds_can_frames(path: str | Path) -> bool:
    """Return True if ``path`` is a bag with CAN frames, which `CanLogReader` can read."""
    return is_bag(path) and CAN_TYPE in topics_of(path).values()


class TopicBagReader:
    """Reads the messages of a bag, any number of times from the start.

    Attributes
    ----------
    topics
        Message types by topic.
    damages
        Missing parts, and messages omitted during the last read.

    Raises
    ------
    LogError
        Raised if the path is not a bag, if the bag has no TaxelArray, or if the extra `bag` is not installed.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self.topics = topics_of(path)
        self.damages: list[Damage] = []
        self._decoder = BagDecoder(path)
        require_topic(path, self.topics, TAXELS, 'Record the topic <pad>/taxels of the driver. docs/recordings.md '
                      'shows how to make a bag of topics from a recording of CAN frames.')

    @property
    def pads(self) -> tuple[str, ...]:
        """Names of the pads with taxel arrays, sorted."""
        return tuple(sorted(pad_of(topic) for topic, kind in self.topics.items() if kind == TAXELS))

    @property
    def unread(self) -> int:
        """Number of messages or parts omitted during the last read."""
        return len(self.damages)

    @property
    def problem(self) -> str:
        """Description of the last part that was omitted."""
        return damage_text(self.damages[-1]) if self.damages else ''

    def messages(self, types: Collection[str], window: TimeWindow = WHOLE) -> Iterator[BagMessage]:
        """Yield the messages of the given types in the window, except TaxelArrays with inconsistent fields."""
        self.damages = []
        behind: float | None = None  # stamp minus time of recording of the last taxel array [s]
        for recorded, content in self._decoder.messages(types, _pair, self.damages.append, window):
            at = recorded.time / SECOND
            if recorded.type == TAXELS:
                if reason := check_taxel_array(content):
                    self.damages.append(Damage(DamageKind.INCONSISTENT, self.path.name, begin=at, end=at,
                                               detail=f'{recorded.topic}: {reason.key}'))
                    continue
                behind = seconds(content.header.stamp) - at
            elif behind is None:
                behind = self._first_behind()
            yield BagMessage(recorded.topic, recorded.type, at, at + behind, content)

    def _first_behind(self) -> float:
        """Return the difference between the stamp and the recording time of the first taxel array, or 0 without any.

        The difference is applied to messages that precede the first taxel array.
        """
        first = next(TopicBagReader(self.path).messages((TAXELS,)), None)
        return 0.0 if first is None else seconds(first.content.header.stamp) - first.recorded


def _pair(recorded: Recorded, content: Any) -> tuple[Recorded, Any]:
    return recorded, content


def pad_of(topic: str) -> str:
    """Return the name of the pad to which a topic belongs.

    >>> pad_of('/left/taxels'), pad_of('/robot/left/shape')
    ('left', 'robot/left')
    """
    return topic.strip('/').rpartition('/')[0]
