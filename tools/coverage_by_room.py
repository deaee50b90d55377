"""Prints how many of each room's lines the tests run, from the JSON report of coverage.py."""

import json
import sys
from collections import defaultdict
from pathlib import Path


def lines_by_room(report: dict) -> dict[str, tuple[int, int]]:
    """Return room -> (lines covered, lines); the modules at the top of the package are the room '.'."""
    rooms: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for name, file in report['files'].items():
        parts = name.split('tactile_node/')[-1].split('/')
        room = rooms[parts[0] if len(parts) > 1 else '.']
        room[0] += file['summary']['covered_lines']
        room[1] += file['summary']['num_statements']
    return {name: (covered, lines) for name, (covered, lines) in sorted(rooms.items())}


def main(path: str) -> None:
    report = json.loads(Path(path).read_text(encoding='utf-8'))
    rooms = lines_by_room(report)
    rooms['all'] = (sum(covered for covered, _ in rooms.values()), sum(lines for _, lines in rooms.values()))
    print('| room | lines | run by the tests |')
    print('| --- | ---: | ---: |')
    for name, (covered, lines) in rooms.items():
        print(f'| {name} | {lines} | {covered / lines if lines else 1:.1%} |')


if __name__ == '__main__':
    main(sys.argv[1])
