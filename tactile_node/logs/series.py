"""Find the files of a recording: a rotated series (session.mcap, session_part2.mcap, ...) or a bag folder."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import yaml

BAG_SUFFIXES = ('.mcap', '.db3')  #: suffixes of bag files


class Part(NamedTuple):
    """One file of a recording. Several consecutive missing files are represented by a single Part."""

    path: Path
    is_there: bool = True


def parts_of(path: str | Path) -> tuple[Part, ...]:
    """Return the files of a recording in the order of recording.

    Parameters
    ----------
    path
        First file of the recording, or a bag folder. A later file of a series counts as a single file.

    Returns
    -------
    tuple of Part
        Files of the recording, including missing files.
    """
    path = Path(path)
    if path.is_dir():
        return _of_folder(path)
    parts, last = [Part(path)], 1
    for number in following(path):
        if number > last + 1:
            parts.append(Part(part(path, last + 1), is_there=False))
        parts.append(Part(part(path, number)))
        last = number
    return tuple(parts)


def files_of(path: str | Path) -> list[Path]:
    """Return the existing files of a recording in the order of recording."""
    return [each.path for each in parts_of(path) if each.is_there]


def part(path: Path, number: int) -> Path:
    """Return the path of file ``number`` (2 or higher) in the series that starts with ``path``.

    >>> part(Path('a/session.log.gz'), 2).name
    'session_part2.log.gz'
    """
    suffix = suffix_of(path)
    return path.with_name(f'{path.name.removesuffix(suffix)}_part{number}{suffix}')


def following(path: Path) -> Sequence[int]:
    """Return the numbers of the later files in the series that starts with ``path``, or an empty sequence."""
    suffix = suffix_of(path)
    pattern = re.compile(f'{re.escape(path.name.removesuffix(suffix))}_part([1-9][0-9]*){re.escape(suffix)}')
    if not path.parent.is_dir():
        return ()
    found = (pattern.fullmatch(each.name) for each in path.parent.iterdir())
    return sorted(number for match in found if match is not None and (number := int(match[1])) > 1)


def suffix_of(path: Path) -> str:
    """Return the suffix of ``path``, with both parts for .log.gz."""
    return ''.join(path.suffixes[-2:]) if path.suffix == '.gz' else path.suffix


def _of_folder(folder: Path) -> tuple[Part, ...]:
    there = {file.name for file in folder.iterdir() if file.suffix in BAG_SUFFIXES}
    names = there | _recorded(folder)
    return tuple(Part(folder / name, name in there)
                 for name in sorted(names, key=lambda name: (len(name), name)))  # the key sorts bag_2 before bag_10


def _recorded(folder: Path) -> set[str]:
    """Return the file names in the folder's metadata, which are missing if the recorder was killed."""
    try:
        content = yaml.safe_load((folder / 'metadata.yaml').read_text(encoding='utf-8'))  # written by rosbag2
        named = content['rosbag2_bagfile_information']['relative_file_paths']
        return {Path(name).name for name in named if Path(name).suffix in BAG_SUFFIXES}
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError):
        return set()
