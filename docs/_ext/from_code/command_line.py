"""The sub-commands of `tactile`, from their argument parsers."""

import argparse
import os
from unittest import mock

from tactile_node.cli.main import COMMANDS, _parser

WIDTH = '100'  # of what argparse writes


def markdown() -> str:
    return '\n\n'.join(f'## tactile {name}\n\n```text\n{help_of(name)}\n```' for name, *_ in COMMANDS)


def help_of(name: str) -> str:
    with mock.patch.dict(os.environ, COLUMNS=WIDTH):
        return parser_of(name).format_help().strip()


def parser_of(name: str) -> argparse.ArgumentParser:
    """The parser of one sub-command."""
    actions = _parser(name)._actions
    subparsers = next(action for action in actions if isinstance(action, argparse._SubParsersAction))
    return subparsers.choices[name]
