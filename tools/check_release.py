"""Check that this checkout can be released as the version in package.xml.

`make release-check` runs this script and then all checks of the project. The script compares the version with the
CHANGELOG, CITATION.cff and the tags, and the definitions in msg/, srv/ and action/ with tools/released_interfaces.json.
With ``--freeze``, the script writes this file instead.
"""

import argparse
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]
FROZEN = ROOT / 'tools/released_interfaces.json'
CHANGELOG = ROOT / 'CHANGELOG.rst'
CITATION = ROOT / 'CITATION.cff'
#: Heading of a section in the form that catkin and bloom read.
HEADING = re.compile(r'^(?P<version>Forthcoming|\d+\.\d+\.\d+)(?: \(\d{4}-\d\d-\d\d\))?\n-+\n', re.MULTILINE)

Definitions = dict[str, list[str]]


def definitions() -> Definitions:
    """Return the fields and constants of each message, service and action, without comments."""
    return {str(path.relative_to(ROOT)): _declared(path.read_text(encoding='utf-8'))
            for folder in ('msg', 'srv', 'action') for path in sorted((ROOT / folder).glob(f'*.{folder}'))}


def _declared(text: str) -> list[str]:
    lines = (' '.join(line.partition('#')[0].split()) for line in text.splitlines())
    return [line for line in lines if line]


def newest_notes(changelog: str) -> tuple[str, str]:
    """Return the version and the text of the first section of a CHANGELOG."""
    headings = [*HEADING.finditer(changelog)]
    end = headings[1].start() if len(headings) > 1 else len(changelog)
    return headings[0]['version'], changelog[headings[0].end():end]


def unannounced(released: Definitions, now: Definitions, notes: str) -> list[str]:
    """Return the files whose definition has changed, and whose name is not in ``notes``.

    >>> unannounced({'msg/A.msg': ['bool a']}, {'msg/A.msg': ['bool b']}, 'The message ``A`` has b instead of a')
    []
    >>> unannounced({'msg/A.msg': ['bool a']}, {'msg/A.msg': ['bool b']}, 'Several improvements')
    ['msg/A.msg']
    """
    changed = [name for name in sorted({*released, *now}) if released.get(name) != now.get(name)]
    return [name for name in changed if f'``{Path(name).stem}``' not in notes]


def frozen() -> tuple[str, Definitions]:
    """Return the version and the definitions of the latest release."""
    content = json.loads(FROZEN.read_text(encoding='utf-8'))
    return content['version'], content['interfaces']


def version() -> str:
    return ElementTree.parse(ROOT / 'package.xml').findtext('version', default='')


def problems() -> Iterator[str]:
    """Yield one sentence for each reason why this checkout cannot be released."""
    noted, _ = newest_notes(CHANGELOG.read_text(encoding='utf-8'))
    if noted != version():
        yield f'CHANGELOG.rst: expected a first section {version()} (date), got {noted}. Rename the section.'
    if f'version: {version()}\n' not in CITATION.read_text(encoding='utf-8'):
        yield f'{CITATION.name}: expected the version {version()}, got another. Correct it.'
    if frozen() != (version(), definitions()):
        yield f'{FROZEN.name}: expected the interfaces of {version()}, got others. Run this script with --freeze.'
    if _git('status', '--porcelain'):
        yield 'git status: expected no uncommitted changes, got some. Commit them.'
    if version() in _git('tag').split():
        yield f'git tag: expected no tag {version()}, got one. Raise the version in package.xml.'


def _git(*words: str) -> str:
    return subprocess.run(['git', *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split('\n', 1)[0])
    parser.add_argument('--freeze', action='store_true', help='write the definitions of the interfaces of this version')
    if parser.parse_args(arguments).freeze:
        content = {'version': version(), 'interfaces': definitions()}
        FROZEN.write_text(json.dumps(content, indent=1) + '\n', encoding='utf-8')
        return 0
    found = [*problems()]
    print('\n'.join(found) or f'{version()} can be released')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
