"""Draws the pictures of failures again, of the reported patterns, without the anchors: after a change of the drawing.

Run from the checkout: python -m bench.recognition.failures docs/recognition [clean ...]
"""

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path

from bench.recognition import familiar
from bench.recognition.cases import Case, clean_cases, field_cases
from bench.recognition.contest import Contest
from bench.recognition.page import draw_failures
from bench.recognition.punches import mechanics_cases
from bench.recognition.sections import AREAS, FIELD_AREAS, FULL, SHOWN
from tactile_node import Recogniser
from tactile_node.simulator.world import Purpose

REPORTED = Purpose.EVALUATION
PICTURES: dict[str, Callable[[], Iterable[Case]]] = {
    'clean': lambda: clean_cases(AREAS, FULL.clean, REPORTED),
    'mechanics': lambda: mechanics_cases(FULL.mechanics, REPORTED),
    'foreign': lambda: familiar.foreign_cases(FULL.figures, FULL.pressed, REPORTED, areas=(SHOWN,)),
    'blemish': lambda: familiar.blemish_cases(max(2, FULL.figures // 4), FULL.pressed, REPORTED, areas=(SHOWN,)),
    'field': lambda: field_cases(FIELD_AREAS, FULL.field, REPORTED)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('names', nargs='*', choices=list(PICTURES), default=list(PICTURES))
    args = parser.parse_args()
    contest = Contest(Recogniser(), {True: [], False: []})
    for name in args.names:
        count = draw_failures(args.folder / f'recognition_failures_{name}.png', map(contest.run, PICTURES[name]()))
        print(f'{name}: {count} failures in all; the caption in the report has to say the same', flush=True)


if __name__ == '__main__':
    main()
