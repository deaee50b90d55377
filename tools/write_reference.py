"""Write what is generated from the code: the tables of docs/reference/, and the schema of skin layouts.

`make reference` runs this script. In a page, everything below the line `<!-- from the code: NAME -->` is the output of
the module NAME in tools/reference/.
"""

import json
import re
from importlib import import_module
from pathlib import Path

from tactile_node.skin.layout_keys import layout_schema

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / 'docs/reference').glob('*.md'))
SCHEMA = ROOT / 'config/skin_layout.schema.json'  #: editors use this file to complete and to check the keys
MARK = re.compile(r'<!-- from the code: (\w+) -->\n')


def page_text(text: str) -> str:
    """Return the text of a page with its generated part as the code says now."""
    mark = MARK.search(text)
    if mark is None:
        raise ValueError(f'expected a line like {MARK.pattern!r} in the page, got none')
    return f'{text[:mark.end()]}\n{import_module(f"reference.{mark[1]}").markdown()}\n'


def schema_text() -> str:
    """Return the text of the schema file."""
    return json.dumps(layout_schema(), indent=1) + '\n'


def main() -> None:
    for page in PAGES:
        page.write_text(page_text(page.read_text(encoding='utf-8')), encoding='utf-8')
    SCHEMA.write_text(schema_text(), encoding='utf-8')


if __name__ == '__main__':
    main()
