"""Generate the help texts of all sub-commands of `tactile` from their argument parsers."""

import argparse
import os
from unittest import mock

from tactile_node.cli.main import COMMANDS, _parser

WIDTH = '100'  # Width of the help texts [columns].


def markdown() -> str:
    parts = []
    for name, *_ in COMMANDS:
        parser = parser_of(name)
        parts += [f'## tactile {name}', _help(parser)]
        for inner, below in _below(parser).items():
            parts += [f'### tactile {name} {inner}', _help(below)]
    return '\n\n'.join(parts)


def parser_of(name: str) -> argparse.ArgumentParser:
    """Return the argument parser of a sub-command."""
    return _below(_parser(name))[name]


def _below(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    return {name: below for action in parser._actions if isinstance(action, argparse._SubParsersAction)
            for name, below in action.choices.items()}


def _help(parser: argparse.ArgumentParser) -> str:
    with mock.patch.dict(os.environ, COLUMNS=WIDTH):
        return f'```text\n{parser.format_help().strip()}\n```'
