"""Decode the messages of a ROS 2 bag without ROS, with the message definitions in the bag."""

from collections.abc import Callable, Collection, Iterable, Iterator
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from tactile_node.logs.bag_records import begin_of, library, records_of
from tactile_node.logs.damage import Damage, DamageKind, OnDamage
from tactile_node.logs.recorded import Recorded
from tactile_node.logs.replay_times import SECOND, WHOLE, TimeWindow
from tactile_node.package_files import package_file

PACKAGE = 'tactile_skin'
CAN_TYPE = 'can_msgs/msg/Frame'
#: definition of CAN_TYPE from the can_msgs package, including all nested types
CAN_DEFINITION = '''std_msgs/Header header
uint32 id
bool is_rtr
bool is_extended
bool is_error
uint8 dlc
uint8[8] data
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
'''
T = TypeVar('T')


class BagDecoder:
    """Decodes the messages of a bag.

    Messages are decoded with the definition in the bag, so that bags from other versions of a package can be read. If
    the bag has no readable definition, the definition of this package or CAN_DEFINITION is used. Messages are read one
    at a time, so that memory use stays low.

    Parameters
    ----------
    path
        Path of the bag: a file or a folder.

    Raises
    ------
    LogError
        Raised if the extra `bag` is not installed.
    """

    def __init__(self, path: str | Path):
        self._path = Path(path)
        self._typesys = library('rosbags.typesys', path)
        self._stores: dict[tuple[str, str], Any] = {}  # type stores by type and definition

    def messages(self, types: Collection[str], made: Callable[[Recorded, Any], T], on_damage: OnDamage,
                 window: TimeWindow = WHOLE) -> Iterator[T]:
        """Yield what ``made`` returns for each message of the given types.

        Parameters
        ----------
        types
            Message types to read.
        made
            Called with each recorded message and its content, which has the fields of the message definition, with
            numbers in NumPy arrays.
        on_damage
            Called with each unreadable part, and with each message for which decoding or ``made`` raises an error.
        window
            Part of the bag to read.

        Raises
        ------
        LogError
            Raised if the path is not a bag.
        """
        bounds = (0, None) if window == WHOLE else window.of(begin_of(self._path))
        for recorded in records_of(self._path, on_damage, *bounds):
            if recorded.type not in types:
                continue
            try:
                found = made(recorded, self._content(recorded))
            except Exception as error:  # rosbags also raises errors from struct, numpy and zstandard
                at = recorded.time / SECOND
                on_damage(Damage(DamageKind.UNDECODABLE, self._path.name, begin=at, end=at,
                                 detail=f'{recorded.topic}: {type(error).__name__}: {error}'))
            else:
                yield found

    def _content(self, recorded: Recorded) -> Any:
        key = recorded.type, recorded.definition
        if key not in self._stores:
            self._stores[key] = self._store(*key)
        return self._stores[key].deserialize_cdr(_decompress(recorded.cdr), recorded.type)

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
        store = message_types(self._typesys, (  # nested types must come first
            'TaxelArray', 'ContactMotion', 'ContactShape', 'FaultyTaxel', 'NodeStatus', 'PadStatus', 'SkinStatus'))
        store.register(self._typesys.get_types_from_msg(CAN_DEFINITION, CAN_TYPE))
        return store


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


def _decompress(data: bytes) -> bytes:
    """Decompress a message. ``ros2 bag record --compression-mode message`` compresses each message separately."""
    if not data.startswith(b'\x28\xB5\x2F\xFD'):  # magic number of Zstandard (RFC 8878), whereas CDR begins with 00
        return data
    return import_module('zstandard').ZstdDecompressor().decompressobj().decompress(data)
