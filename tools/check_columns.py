"""Report lines longer than 120 columns in files that no other linter checks: documents, YAML, messages, make.

The script skips table rows in *_results.md and in docs/reference/, because the benchmarks and `make reference` write
these rows, and a row cannot be wrapped.
"""

import subprocess
import sys
from pathlib import Path

COLUMNS = 120
PATTERNS = ('*.md', '*.yaml', '*.msg', '*.srv', '*.action', '*.in', '*.cfg', '*.toml', '*.xml', 'Makefile',
            'CMakeLists.txt')


def long_lines(path: Path) -> list[str]:
    """Return a message 'file:line: columns ...' for each line that is too long."""
    lines = path.read_text(encoding='utf-8').splitlines()
    return [f'{path}:{number}: {len(line)} columns, at most {allowed} fit'
            for number, line in enumerate(lines, start=1) if len(line) > (allowed := columns_of(path, line))]


def columns_of(path: Path, line: str) -> int:
    """Return the number of columns allowed for a line."""
    is_generated = path.name.endswith('_results.md') or path.parent.name == 'reference'
    return sys.maxsize if is_generated and line.startswith('|') else COLUMNS


def main(arguments: list[str]) -> int:
    """Check the files named as arguments or, without arguments, all files in the repository that match PATTERNS."""
    names = arguments or subprocess.run(
        ['git', 'ls-files', '--', *PATTERNS], check=True, capture_output=True, text=True).stdout.splitlines()
    found = [line for name in names if Path(name).is_file() for line in long_lines(Path(name))]
    print('\n'.join(found), end='\n' if found else '')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
