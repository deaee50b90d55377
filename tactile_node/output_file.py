"""Write output files that are either complete or unchanged.

A new file is written next to its destination and renamed once it is complete.
"""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import mkstemp
from typing import BinaryIO

from tactile_node.errors import InputError


@contextmanager
def output_file(path: str | Path, inputs: Iterable[str | Path] = ()) -> Iterator[BinaryIO]:
    """Open a binary file for writing. If an error occurs inside the block, the previous file remains unchanged.

    Devices and pipes are written directly. Links are followed.

    Parameters
    ----------
    path : str or Path
        The file.
    inputs : iterable of str or Path
        Files that must not be overwritten.

    Raises
    ------
    InputError
        Raised if the file is one of ``inputs`` or cannot be written.
    """
    target = Path(os.path.realpath(path))
    _check_no_input(path, inputs)
    try:
        if _is_device(path):
            with open(path, 'wb') as device:
                yield device
            return
        descriptor, name = mkstemp(prefix=f'.{target.name}.', dir=target.parent)
        beside = Path(name)
        try:
            with open(descriptor, 'wb') as stream:
                yield stream
            beside.chmod(_mode(target))
            beside.replace(target)
        finally:
            with suppress(FileNotFoundError):
                beside.unlink()
    except OSError as error:
        raise InputError(f'output {str(path)!r}', expected='a file that can be written',
                         got=error.strerror or str(error), remedy='Give another path, or free disk space.') from error


def check_writable(path: str | Path, inputs: Iterable[str | Path] = (), *, force: bool) -> None:
    """Raise InputError if an output file cannot be written. Commands call this function before a long computation.

    Parameters
    ----------
    path : str or Path
        The file.
    inputs : iterable of str or Path
        Files that must not be overwritten.
    force : bool
        True to allow an existing file to be replaced.

    Raises
    ------
    InputError
        Raised if the file cannot be written, is one of ``inputs``, or exists and ``force`` is False.
    """
    target = Path(os.path.realpath(path))
    _check_no_input(path, inputs)
    check_new(path, force=force)
    if not os.access(path if _is_device(path) else target.parent, os.W_OK) or target.is_dir():
        raise InputError(f'output {str(path)!r}', expected='a file that can be written',
                         got='a folder' if target.is_dir() else 'no folder that can be written',
                         remedy='Give another path.')


def check_new(path: str | Path, *, force: bool) -> None:
    """Raise InputError if ``path`` exists and ``force`` is False. Devices and pipes may exist."""
    if not force and os.path.lexists(path) and (os.path.isdir(path) or not _is_device(path)):
        raise InputError(f'output {str(path)!r}', expected='a new file', got='one that exists',
                         remedy='Give another path, or replace the file with --force.')


def _check_no_input(path: str | Path, inputs: Iterable[str | Path]) -> None:
    if os.path.realpath(path) in map(os.path.realpath, inputs):
        raise InputError(f'output {str(path)!r}', expected='a file other than the input', got='the input',
                         remedy='Give another path.')


def _is_device(path: str | Path) -> bool:
    """Return True if ``path`` exists and is not a regular file.

    The check works on the given path, because links to pipes in /proc do not resolve to a path.
    """
    return os.path.exists(path) and not os.path.isfile(path)


def _mode(target: Path) -> int:
    """Return the mode of the file that is being replaced, or the mode that the umask gives a new file."""
    try:
        return target.stat().st_mode & 0o777
    except FileNotFoundError:
        mask = os.umask(0)  # the only way to read the umask is to set it
        os.umask(mask)
        return 0o666 & ~mask
