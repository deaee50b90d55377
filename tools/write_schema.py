"""Write config/skin_layout.schema.json, which editors use for completion, from the keys in the code: `make schema`."""

import json
from pathlib import Path

from tactile_node.skin.layout_keys import layout_schema

FILE = Path(__file__).resolve().parents[1] / 'config/skin_layout.schema.json'


def text() -> str:
    """Return the text of the schema file."""
    return json.dumps(layout_schema(), indent=1) + '\n'


if __name__ == '__main__':
    FILE.write_text(text(), encoding='utf-8')
