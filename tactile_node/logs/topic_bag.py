"""Our topics in a ROS 2 bag: taxel frames by pad, and the other messages, without ROS.

The bag's own definition of a message is preferred, so that bags of other versions of this package are read; where the
bag has none, or one that cannot be read, that of msg/ counts. Messages are read one by one, never all at once.
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
    """Return the frame of a TaxelArray that has passed `check_taxel_array`."""
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
TAXELS, STATUS = f'{PACKAGE}/msg/TaxelArray', f'{PACKAGE}/msg/SkinStatus'
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'


class BagMessage(NamedTuple):
    """A message with the fields of its definition; arrays of numbers are NumPy's."""

    topic: str
    type: str
    recorded: float  #: [s, Unix epoch]
    #: when, by the clock of the taxel frames' stamps: a replay has those of its log, another computer its own
    stamp: float
    content: Any


def holds_taxels(path: str | Path) -> bool:
    """Return whether ``path`` is a bag with our taxel arrays; of a bag that also has CAN frames, both are."""
    return is_bag(path) and TAXELS in topics_of(path).values()


def holds_can_frames(path: str | Path) -> bool:
    """Return whether ``path`` is a bag with CAN frames, which `CanLogReader` reads."""
    return is_bag(path) and CAN_TYPE in topics_of(path).values()


class TopicBagReader:
    """Reads a bag as often as it is asked to, each time from its begin.

    ``unread`` counts, by reason, what the last reading left out, ``problem`` describes the last of it, ``damages`` has
    where files are damaged. Raises LogError for a path that is no bag, a bag without a TaxelArray and without the extra
    `bag`.
    """

    def __init__(self, path: str | Path):
        self.path = str(path)
        self.topics = topics_of(path)  #: {topic: type}
        self.unread: Counter[DamageKind] = Counter()
        self.problem = ''
        self.damages: list[Damage] = []
        self._types = _TopicTypes(path)
        self._behind: float | None = None  # stamp of the last taxel array less its time of recording [s]
        if TAXELS not in self.topics.values():
            got = ', '.join(f'{topic} ({kind})' for topic, kind in sorted(self.topics.items())) or (
                'no topic that can be read')
            raise LogError(self.path, expected=f'a bag with a topic of type {TAXELS}', got=got,
                           remedy='Record <pad>/taxels of the driver.')

    @property
    def pads(self) -> tuple[str, ...]:
        """Names of the pads of which there are taxel arrays, sorted."""
        return tuple(sorted(pad_of(topic) for topic, kind in self.topics.items() if kind == TAXELS))

    def messages(self, types: Collection[str], window: TimeWindow = WHOLE) -> Iterator[BagMessage]:
        """Give the messages of ``types`` within ``window``; a TaxelArray only where its fields fit together."""
        self._behind = None
        self.unread, self.problem, self.damages = Counter(), '', []
        bounds = (0, None) if window == WHOLE else window.of(begin_of(self.path))
        for recorded in records_of(self.path, self._damaged, *bounds):
            if recorded.type in types:
                yield from self._read(recorded)

    def _read(self, recorded: Recorded) -> Iterator[BagMessage]:
        try:
            content = self._types.content(recorded)
        except Exception as error:  # rosbags raises what struct, numpy and zstandard raise
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
        """Return stamp - recorded of the first taxel array, for what comes before it; 0 where none follows."""
        first = next(TopicBagReader(self.path).messages((TAXELS,)), None)
        return 0.0 if first is None else seconds(first.content.header.stamp) - first.recorded

    def _damaged(self, damage: Damage) -> None:
        self.damages.append(damage)
        self._leave_out(damage.kind, damage_text(damage))

    def _leave_out(self, reason: DamageKind, problem: str) -> None:
        self.unread[reason] += 1
        self.problem = problem


def pad_of(topic: str) -> str:
    """Return the name of the pad that a topic is of.

    >>> pad_of('/left/taxels'), pad_of('/robot/left/shape')
    ('left', 'robot/left')
    """
    return topic.strip('/').rpartition('/')[0]


class _TopicTypes:
    """Decodes messages by the definition in the bag, or by ours."""

    def __init__(self, path: str | Path):
        self._typesys = library('rosbags.typesys', path)
        self._stores: dict[tuple[str, str], Any] = {}  # by type and definition

    def content(self, recorded: Recorded) -> Any:
        key = recorded.type, recorded.definition
        if key not in self._stores:
            self._stores[key] = self._store(*key)
        return self._stores[key].deserialize_cdr(decompress(recorded.cdr), recorded.type)

    def _store(self, kind: str, definition: str) -> Any:
        """A store for each: a type that it contains may be defined in another way in the next bag."""
        if definition:
            try:
                store = self._typesys.get_typestore(self._typesys.Stores.EMPTY)
                store.register(self._typesys.get_types_from_msg(definition, kind))
                store.get_msgdef(kind)
                return store
            except Exception:  # the parser raises its own errors over a damaged text
                pass
        return self._ours

    @cached_property
    def _ours(self) -> Any:
        return message_types(self._typesys, (  # each after those that it contains
            'TaxelArray', 'ContactMotion', 'ContactShape', 'FaultyTaxel', 'NodeStatus', 'PadStatus', 'SkinStatus'))


def message_types(typesys: Any, names: Iterable[str]) -> Any:
    """Return a store of ROS 2 Jazzy and of our messages of ``names``; ``typesys``: rosbags.typesys."""
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for name in names:
        text = package_file(f'msg/{name}.msg').read_text(encoding='utf-8')
        store.register(typesys.get_types_from_msg(text, f'{PACKAGE}/msg/{name}'))
    return store
