"""Python classes of message packages that PyPI lacks, without a middleware: to fill and to read, not to send."""

import importlib.util
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from built_messages import INTERFACES, source


@contextmanager
def generated_messages(name: str, folder: Path) -> Iterator[None]:
    """Make package ``name``, and those it needs, importable: the installed ones, or made in ``folder``.

    It takes a second; to build what can be sent takes a minute.
    """
    if importlib.util.find_spec(name):
        yield
        return
    os.environ.setdefault('AMENT_PREFIX_PATH', sys.prefix)  # where the generator has its templates
    from rosidl_generator_py.cli import GeneratePython
    made = [each for each in (*INTERFACES[name][0], name) if each in INTERFACES]
    for package in made:
        for file, text in source(package).items():
            if file.startswith('msg/'):
                path = folder / package / file
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding='utf-8')
        files = [f'{folder / package}:msg/{message}.msg' for message in INTERFACES[package][1]]
        GeneratePython('py', typesupport_implementations=[]).generate(package, files, [], folder / 'python' / package)
        (folder / 'python' / package / '__init__.py').touch()
    sys.path.append(str(folder / 'python'))
    try:
        yield
    finally:
        sys.path.remove(str(folder / 'python'))
        for module in [each for each in sys.modules if each.split('.')[0] in made]:
            del sys.modules[module]
