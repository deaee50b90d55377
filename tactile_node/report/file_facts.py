"""Which file, which layout, which software: so that a ticket's page can be distinguished from any other."""

import hashlib
import platform
from importlib import metadata
from pathlib import Path

from tactile_node.package_files import config_path
from tactile_node.recording.series import files_of
from tactile_node.report.model import Kind, Recording
from tactile_node.version import package_version

LIBRARIES = ('python-can', 'canopen', 'numpy', 'scipy', 'rosbags', 'mcap')
CHUNK = 1 << 20  # bytes


def versions() -> tuple[tuple[str, str], ...]:
    """Return name and version of what made the report; a library that is not installed is left out."""
    found = []
    for name in LIBRARIES:
        try:
            found.append((name, metadata.version(name)))
        except metadata.PackageNotFoundError:
            continue
    return (('tactile_skin', package_version()), ('Python', platform.python_version()), *found,
            ('system', f'{platform.system()} {platform.machine()}'))


def recording_of(path: str | Path, kind: Kind, begin: float, end: float) -> Recording:
    """Return what is known of a file, a series of files or a bag's folder. Raises OSError where it cannot be read."""
    path = Path(path)
    files = [file for file in path.rglob('*') if file.is_file()] if path.is_dir() else files_of(path)
    return Recording(name=path.resolve().name, size=sum(file.stat().st_size for file in files),
                     sha256='' if path.is_dir() or len(files) > 1 else _sha256(path), kind=kind, begin=begin, end=end)


def layout_name(source: str) -> str:
    return Path(source).name


def layout_digest(source: str) -> str:
    """SHA-256 of the layout file."""
    return _sha256(config_path(source))


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open('rb') as file:
        while chunk := file.read(CHUNK):
            digest.update(chunk)
    return digest.hexdigest()
