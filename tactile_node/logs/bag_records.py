"""Read the raw messages of a ROS 2 bag in order without ROS: .mcap, .db3 (rosbag2) or a bag folder."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from tactile_node.errors import LogError
from tactile_node.logs.damage import Damage, DamageKind, OnDamage, placed
from tactile_node.logs.recorded import Recorded
from tactile_node.logs.replay_times import SECOND
from tactile_node.logs.series import BAG_SUFFIXES, files_of, parts_of
from tactile_node.logs.sqlite_file import SqliteFile

if TYPE_CHECKING:
    from tactile_node.logs.mcap_file import McapFile


def is_bag(path: str | Path) -> bool:
    """Return True if the path is a bag: a file with a bag suffix, or a folder."""
    return Path(path).suffix in BAG_SUFFIXES or Path(path).is_dir()


def records_of(path: str | Path, on_damage: OnDamage, since: int = 0, until: int | None = None) -> Iterator[Recorded]:
    """Yield the messages from all files of a recording.

    Parameters
    ----------
    path
        Path of the bag: a file or a folder.
    on_damage
        Called with each unreadable part before the next message is yielded.
    since, until
        Range of recording times [ns]. Messages with since <= time < until are read.

    Raises
    ------
    LogError
        Raised if the path is not a bag.
    """
    for recorded in placed(_found(path, since), lambda recorded: recorded.time / SECOND, on_damage):
        if until is None or recorded.time < until:
            yield recorded
        elif recorded.time >= until + SECOND:  # messages can be out of order by less than a second
            return


def begin_of(path: str | Path) -> int:
    """Return the recording time of the first message [ns], or 0 if there is none. Raises LogError."""
    first = bag_parts(path)[0]
    if first.is_file():
        with bag_file(first) as file:
            if file.begin is not None:
                return file.begin
    recorded = next(records_of(path, lambda _: None), None)
    return 0 if recorded is None else recorded.time


def topics_of(path: str | Path) -> dict[str, str]:
    """Return the type of each topic in the bag.

    Topics in a damaged part may be missing. If the recorder did not finish the bag, the function reads the whole bag.

    Raises
    ------
    LogError
        Raised if the path is not a bag.
    """
    found: dict[str, str] = {}
    for part in filter(Path.is_file, bag_parts(path)):
        with bag_file(part) as file:
            found |= file.topics()
    return found


def require_topic(path: str | Path, topics: Mapping[str, str], kind: str, remedy: str) -> None:
    """Raise LogError if none of the topics has the message type ``kind``. ``topics`` maps topics to types."""
    if kind not in topics.values():
        got = ', '.join(f'{topic} ({other})' for topic, other in sorted(topics.items())) or 'no readable topic'
        raise LogError(str(path), expected=f'a bag with a topic of type {kind}', got=got, remedy=remedy)


def library(name: str, path: str | Path):
    """Import an optional library for bags. If the library is missing, raise LogError with installation instructions."""
    try:
        return import_module(name)
    except ImportError as error:
        raise LogError(str(path), expected='the libraries needed to read bags', got=str(error),
                       remedy="Install these libraries: pip install 'tactile-skin[bag]'.") from error


def bag_parts(path: str | Path) -> tuple[Path, ...]:
    """Return the .mcap and .db3 files of a bag in recording order. Raises LogError if the bag has no such files."""
    path = Path(path)
    if not path.exists():
        raise LogError(str(path), expected='a bag', got='no such file', remedy='Check the path.')
    if not files_of(path):
        raise LogError(str(path), expected='a bag with .mcap or .db3 files', got='a folder without such files',
                       remedy='If the bag is compressed, decompress it first (ros2 bag convert).')
    return parts_of(path)


def _found(path: str | Path, since: int) -> Iterator[Recorded | Damage]:
    for part in bag_parts(path):
        if part.is_file():
            with bag_file(part) as file:
                yield from file.read(since)
        else:
            yield Damage(DamageKind.MISSING_FILE, part.name)


@contextmanager
def bag_file(path: Path) -> Iterator['McapFile | SqliteFile']:
    """Open one file of a bag. Raises LogError if the library for .mcap files is missing."""
    if path.suffix == '.db3':
        yield SqliteFile(path)
    else:
        module = library('tactile_node.logs.mcap_file', path)
        with path.open('rb') as file:
            yield module.McapFile(file, path.name)
