"""The recording that a report is about. Stamps are Unix time [s]."""

import hashlib
from dataclasses import dataclass
from enum import Enum, unique
from pathlib import Path
from typing import Any

from tactile_node.logs.damage import Damage
from tactile_node.logs.series import files_of

DIGEST_CHUNK = 1 << 20  #: [bytes]


@unique
class Kind(Enum):
    """Kind of data in the recording."""

    CAN_FRAMES = 'CAN frames'
    TOPICS = 'ROS topics'


@dataclass(frozen=True)
class ReportedFile:
    """Facts about the recording itself: a file, a series of files or a bag folder."""

    name: str          #: file name without the folder
    size: int          #: size of the file, or of all files of a bag [bytes]
    sha256: str        #: SHA-256 checksum of a single file, or '' for several files
    kind: Kind
    begin: float
    end: float
    unread: int = 0    #: number of lines, messages or broken parts that could not be read
    problem: str = ''  #: reason why the last unread part could not be read
    clock_jumps: int = 0
    damages: tuple[Damage, ...] = ()  #: damaged places in a bag or a series of files

    @classmethod
    def of(cls, path: str | Path, kind: Kind, begin: float, end: float, **problems: Any) -> 'ReportedFile':
        """Return the facts about the recording at ``path``. Raises OSError if a file cannot be read."""
        path, files = Path(path), files_in(path)
        return cls(path.resolve().name, sum(file.stat().st_size for file in files),
                   '' if path.is_dir() or len(files) > 1 else sha256_of(path), kind, begin, end, **problems)


def files_in(path: str | Path) -> list[Path]:
    """Return all files of a recording, with the metadata of a bag folder."""
    path = Path(path)
    return [file for file in path.rglob('*') if file.is_file()] if path.is_dir() else files_of(path)


def sha256_of(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open('rb') as file:
        while chunk := file.read(DIGEST_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()
