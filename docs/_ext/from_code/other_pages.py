"""Generate toctree entries for the pages in docs/ that docs/index.rst does not list."""

from collections.abc import Iterable
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2]
NO_PAGES = ('README',)


def markdown() -> str:
    return '\n   '.join(others((DOCS / 'index.rst').read_text(encoding='utf-8'),
                              (path.stem for path in DOCS.glob('*.md'))))


def others(index: str, pages: Iterable[str]) -> list[str]:
    """Return the pages that ``index`` does not list, sorted by name.

    >>> others('   hardware\\n   <!-- -->', ['view', 'hardware', 'README'])
    ['view']
    """
    named = {line.strip() for line in index.splitlines()}
    return sorted(set(pages) - named - set(NO_PAGES))
