"""Sphinx extension: `<!-- from the code: NAME -->` in a page becomes what GENERATORS[NAME] makes of the code.

Pages on GitHub show nothing there; nothing that is generated is committed.
"""

import re
from collections.abc import Callable
from importlib import import_module

MARK = re.compile(r'<!-- from the code: (\w+) -->')
#: module of this package, imported when a page needs it; each has a function `markdown`
GENERATORS = ('parameters', 'counters', 'interfaces', 'graph', 'command_line', 'layout_keys', 'library', 'other_pages')


def filled(text: str, missing: Callable[[str, ModuleNotFoundError], str]) -> str:
    """Return a page with each mark replaced; ``missing`` says what stands there without a module the code needs."""
    return MARK.sub(lambda mark: _generated(mark[1], missing), text)


def _generated(name: str, missing: Callable[[str, ModuleNotFoundError], str]) -> str:
    if name not in GENERATORS:
        raise KeyError(f'{name}: no generator; there are {", ".join(GENERATORS)}')
    try:
        return import_module(f'{__name__}.{name}').markdown()
    except ModuleNotFoundError as error:
        return missing(name, error)


def shortened(app, what: str, name: str, thing: object, options: object, signature: str | None,
              returned: str | None) -> tuple[str, str | None] | None:
    """Write NumPy's ArrayLike by its name: it is a union of ten types, and Python does not keep the name."""
    from numpy.typing import ArrayLike
    from sphinx.util.typing import stringify_annotation
    written = stringify_annotation(ArrayLike, 'smart')
    return (signature.replace(written, 'ArrayLike'), returned) if signature and written in signature else None


def setup(app) -> dict[str, bool]:
    from sphinx.util import logging
    logger = logging.getLogger(__name__)

    def fill(app, page: str, content: list[str]) -> None:
        def missing(name: str, error: ModuleNotFoundError) -> str:
            logger.warning('%s: %s is not generated without the module %s', page, name, error.name)
            return f'*Not in this build: it needs the Python module {error.name}.*'
        content[0] = filled(content[0], missing)

    app.connect('source-read', fill)
    app.connect('autodoc-process-signature', shortened)
    return {'parallel_read_safe': True}
