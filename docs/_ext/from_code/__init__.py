"""Sphinx extension that replaces each mark `<!-- from the code: NAME -->` in a page with generated documentation.

The module NAME of this package generates the documentation from the code. The generated documentation is not committed,
so GitHub shows nothing in place of the mark.
"""

import re
from collections.abc import Callable
from importlib import import_module

MARK = re.compile(r'<!-- from the code: (\w+) -->')
#: Modules that generate documentation with their function `markdown`. A module is imported only if a page needs it.
GENERATORS = ('parameters', 'counters', 'interfaces', 'graph', 'command_line', 'layout_keys', 'library', 'other_pages')


def filled(text: str, missing: Callable[[str, ModuleNotFoundError], str]) -> str:
    """Return the text of a page with each mark replaced by generated documentation.

    Parameters
    ----------
    text : str
        Text of the page.
    missing : Callable[[str, ModuleNotFoundError], str]
        Function that returns a replacement for a mark if its generator needs a Python module that is not installed. The
        function gets the name in the mark and the import error.
    """
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
    """Return a signature in which NumPy's ArrayLike has its short name.

    ArrayLike is a union of ten types, and Sphinx would print all ten.
    """
    from numpy.typing import ArrayLike
    from sphinx.util.typing import stringify_annotation
    written = stringify_annotation(ArrayLike, 'smart')
    return (signature.replace(written, 'ArrayLike'), returned) if signature and written in signature else None


def setup(app) -> dict[str, bool]:
    from sphinx.util import logging
    logger = logging.getLogger(__name__)

    def fill(app, page: str, content: list[str]) -> None:
        def missing(name: str, error: ModuleNotFoundError) -> str:
            logger.warning('%s: cannot generate the part %s, because the Python module %s is not installed', page, name,
                           error.name)
            return f'*This build does not contain this part, because the Python module {error.name} was not installed.*'
        content[0] = filled(content[0], missing)

    app.connect('source-read', fill)
    app.connect('autodoc-process-signature', shortened)
    return {'parallel_read_safe': True}
