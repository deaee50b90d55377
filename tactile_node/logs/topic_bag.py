"""Read this package's topics from a ROS 2 bag without ROS.

Messages are decoded with the definition in the bag, so that bags from other versions of this package can be read. If
the bag has no readable definition, the definition in msg/ is used. Messages are read one at a time, so that memory use
stays low.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tactile_node.errors import LogError
from tactile_node.logs.bag_log import CAN_TYPE
from tactile_node.logs.bag_records import Recorded, begin_of, decompress, is_bag, library, records_of, topics_of
from tactile_node.logs.damage import Damage, DamageKind, damage_text
from tactile_node.logs.replay_times import SECOND, WHOLE, TimeWindow
from tactile_node.package_files import package_file
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


PACKAGE = 'tactile_skin'
TAXELS = f'{PACKAGE}/msg/TaxelArray'
STATUS = f'{PACKAGE}/msg/SkinStatus'
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
    unread
        Number of messages or parts omitted during the last read, by reason.
    problem
        Description of the last part that was omitted.
    damages
        Places where the files are damaged.

    Raises
    ------
    LogError
        Raised if the path is not a bag, if the bag has no TaxelArray, or if the extra `bag` is not installed.
    """

    def __init__(self, path: str | Path):
        self.path = str(path)
        self.topics = topics_of(path)
        self.unread: Counter[DamageKind] = Counter()
        self.problem = ''
        self.damages: list[Damage] = []
        self._types = _TopicTypes(path)
        self._behind: float | None = None  # difference of stamp and recording time, for the last taxel array [s]
        if TAXELS not in self.topics.values():
            got = ', '.join(f'{topic} ({kind})' for topic, kind in sorted(self.topics.items())) or (
                'no readable topic')
            raise LogError(self.path, expected=f'a bag with a topic of type {TAXELS}', got=got,
                           remedy='Record the topic <pad>/taxels of the driver.')

    @property
    def pads(self) -> tuple[str, ...]:
        """Names of the pads with taxel arrays, sorted."""
        return tuple(sorted(pad_of(topic) for topic, kind in self.topics.items() if kind == TAXELS))

    def messages(self, types: Collection[str], window: TimeWindow = WHOLE) -> Iterator[BagMessage]:
        """Yield the messages of the given types in the window, except TaxelArrays with inconsistent fields."""
        self._behind = None
        self.unread, self.problem, self.damages = Counter(), '', []
        bounds = (0, None) if window == WHOLE else window.of(begin_of(self.path))
        for recorded in records_of(self.path, self._damaged, *bounds):
            if recorded.type in types:
                yield from self._read(recorded)

    def _read(self, recorded: Recorded) -> Iterator[BagMessage]:
        try:
            content = self._types.content(recorded)
        except Exception as error:  # rosbags also raises errors from struct, numpy and zstandard
            self._leave_out(DamageKind.UNDECODABLE, f'{recorded.topic}: {error}')
            return
        if recorded.type == TAXELS and (reason := check_taxel_array(content)):
            self._leave_out(DamageKind.INCONSISTENT, f'{recorded.topic}: {reason.key}')
            return
        at = recorded.time / SECOND
        if recorded.type == TAXELS:
            self._behind = seconds(content.header.stamp) - at
        elif self._behind is None:
            self._behind = self._first_behind()
        yield BagMessage(recorded.topic, recorded.type, at, at + self._behind, content)

    def _first_behind(self) -> float:
        """Return the difference between the stamp and the recording time of the first taxel array, or 0 without any.

        The difference is applied to messages that precede the first taxel array.
        """
        first = next(TopicBagReader(self.path).messages((TAXELS,)), None)
        return 0.0 if first is None else seconds(first.content.header.stamp) - first.recorded

    def _damaged(self, damage: Damage) -> None:
        self.damages.append(damage)
        self._leave_out(damage.kind, damage_text(damage))

    def _leave_out(self, reason: DamageKind, problem: str) -> None:
        self.unread[reason] += 1
        self.problem = problem


def pad_of(topic: str) -> str:
    """Return the name of the pad to which a topic belongs.

    >>> pad_of('/left/taxels'), pad_of('/robot/left/shape')
    ('left', 'robot/left')
    """
    return topic.strip('/').rpartition('/')[0]


class _TopicTypes:
    """Decodes messages with the definition in the bag or, if the bag has none, with the definition in msg/."""

    def __init__(self, path: str | Path):
        self._typesys = library('rosbags.typesys', path)
        self._stores: dict[tuple[str, str], Any] = {}  # type stores by type and definition

    def content(self, recorded: Recorded) -> Any:
        key = recorded.type, recorded.definition
        if key not in self._stores:
            self._stores[key] = self._store(*key)
        return self._stores[key].deserialize_cdr(decompress(recorded.cdr), recorded.type)

    def _store(self, kind: str, definition: str) -> Any:
        """Return a new type store for a definition, because another bag may define a nested type differently."""
        if definition:
            try:
                store = self._typesys.get_typestore(self._typesys.Stores.EMPTY)
                store.register(self._typesys.get_types_from_msg(definition, kind))
                store.get_msgdef(kind)
                return store
            except Exception:  # the parser raises various errors for a damaged definition
                pass
        return self._ours

    @cached_property
    def _ours(self) -> Any:
        return message_types(self._typesys, (  # nested types must come first
            'TaxelArray', 'ContactMotion', 'ContactShape', 'FaultyTaxel', 'NodeStatus', 'PadStatus', 'SkinStatus'))


def message_types(typesys: Any, names: Iterable[str]) -> Any:
    """Return a store with the types of ROS 2 Jazzy and the given messages of this package.

    Parameters
    ----------
    typesys
        The module rosbags.typesys.
    names
        Names of this package's messages. Nested message types must precede the types that contain them.
    """
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for name in names:
        text = package_file(f'msg/{name}.msg').read_text(encoding='utf-8')
        store.register(typesys.get_types_from_msg(text, f'{PACKAGE}/msg/{name}'))
    return store
