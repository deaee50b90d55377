# PYTHON_ARGCOMPLETE_OK
"""The program `tactile`: finds the sub-command and turns every error of this package into one line."""

import argparse
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec

import tactile_node
from tactile_node.errors import TactileError
from tactile_node.interruption import ignore_interruptions

#: name and help, the first ones in the order in which one needs them; the module of that name, with ``add_options`` and
#: ``run``, is imported only when it is chosen
COMMANDS = (
    ('simulate', 'be a CANopen skin that touches shapes or repeats a recording'),
    ('scan', 'find the CANopen nodes of a bus'),
    ('draft', 'begin a skin layout from an EDS'),
    ('check', 'check a skin layout and its EDS, and show the pad'),
    ('bringup', 'run all ROS 2 nodes of one bus in this process'),
    ('view', 'show the pads in a browser or on a terminal'),
    ('tare', 'set the zero of the pads of a running driver'),
    ('record', 'record a CAN log from a live bus'),
    ('replay', 'play a CAN log without ROS: taxel frames to a file'),
    ('classify', 'the recognised shape, of frames in files: JSON lines or CSV'),
    ('report', 'write a page on a log or bag, for a support ticket'),
    ('features', 'every quantity of the paper, of frames in files: JSON lines or CSV'),
    ('calibrate', "learn a skin's response from presses of a known disc"),
    ('teach', 'teach the recogniser your own shapes'),
    ('assess', 'how reliable recognition is on your own skin, and an adaptation to it'),
    ('sdo', 'read or write one object of a device'),
    ('completion', 'print what makes your shell complete `tactile`'),
)
FIRST_COMMANDS = 11

#: It runs nodes, whose handler forwards the log to /rosout and stderr.
RUNS_NODES = 'bringup'

#: by command, what its help would promise in vain without
NEEDED = {'simulate': ('termios',), 'bringup': ('rclpy', 'tactile_skin'), 'view': ('viser',),
          'tare': ('rclpy', 'tactile_skin'), 'completion': ('argcomplete',)}
_ROS = 'Source a ROS 2 workspace that holds tactile_skin, or run `make setup` once.'
NEEDS = {'rclpy': _ROS, 'rcl_interfaces': _ROS, 'tactile_skin': _ROS,
         'can': 'Install it: pip install python-can.', 'canopen': 'Install it: pip install canopen (docs/install.md).',
         'jinja2': 'Install it: pip install jinja2.',
         'termios': 'It is part of Python on Linux and macOS alone: run this there.',
         'matplotlib': "Install it: pip install 'tactile-skin[picture]'.",
         'viser': "Install it: pip install 'tactile-skin[view]'.",
         'PIL': "Install Pillow: pip install 'tactile-skin[picture]'.",
         'argcomplete': "Install it: pip install 'tactile-skin[completion]'."}

#: set by the shell when it asks for completions; its value is the number of words that start the program
COMPLETES = '_ARGCOMPLETE'


def main(argv: list[str] | None = None) -> int:
    """Run `tactile` with ``argv`` and return its exit code: 2 for bad input, 130 for Ctrl-C."""
    argv = sys.argv[1:] if argv is None else argv
    try:
        args = _parser(argv[0] if argv else '').parse_args(argv)
        with _logging(argv[0]):
            status = args.run(args)
        sys.stdout.flush()
        return status
    except TactileError as error:
        print(f'tactile: error: {error}', file=sys.stderr)
        return 2
    except ModuleNotFoundError as error:
        if error.name not in NEEDS:
            raise
        print(f'tactile: error: {argv[0]} needs the Python module {error.name}, which is missing. '
              f'{NEEDS[error.name]}', file=sys.stderr)
        return 2
    except BrokenPipeError:
        # The reader (head, less) has gone; keep Python from failing again when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        return 130


def program() -> int:
    """`main` as a process: a second Ctrl-C does not make its clean end look like a crash."""
    if COMPLETES in os.environ:
        import argcomplete

        from tactile_node.cli.completion import chosen_command
        argcomplete.autocomplete(_parser(chosen_command(os.environ)))  # which ends the process
    try:
        return main()
    finally:
        ignore_interruptions()


@contextmanager
def _logging(command: str) -> Iterator[None]:
    """Print warnings and errors of the package to stderr, unless ``command`` runs nodes."""
    if command == RUNS_NODES:
        yield
        return
    handler = logging.StreamHandler(sys.stderr)
    handler.setLevel(logging.WARNING)
    handler.setFormatter(logging.Formatter('tactile: %(message)s'))
    logger = logging.getLogger('tactile_node')
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


class _Program(argparse.ArgumentParser):
    """Parser whose help has a line for each command: first what one does first, in that order."""

    def format_help(self) -> str:
        lines = [f'    {name:<12}{text}{_lack(name)}' for name, text in COMMANDS]
        return '\n'.join((f'{self.format_usage()}\n{self.description}', '', 'What one does first, in this order:',
                          *lines[:FIRST_COMMANDS], '', 'More:', *lines[FIRST_COMMANDS:],
                          '    --version   print the version', '', f'{self.epilog}', ''))


def _parser(chosen: str) -> argparse.ArgumentParser:
    """Parser of all sub-commands, complete for the ``chosen`` one alone, so that no other is imported."""
    parser = _Program(prog='tactile', description='Contact shape from a tactile skin on a CAN bus.',
                      epilog='`tactile COMMAND --help` explains a command.')
    version = f'tactile_skin {tactile_node.__version__}' if chosen == '--version' else ''
    parser.add_argument('--version', action='version', version=version)
    commands = parser.add_subparsers(required=True, metavar='COMMAND', parser_class=argparse.ArgumentParser)
    for name, text in COMMANDS:
        command = commands.add_parser(name, help=text)
        if name == chosen:
            module = import_module(f'tactile_node.cli.{name}')
            command.description = module.__doc__
            if '\n' in str(module.__doc__):  # it has its own lines
                command.formatter_class = argparse.RawDescriptionHelpFormatter
            command.set_defaults(run=module.run)
            module.add_options(command)
    return parser


def _lack(command: str) -> str:
    """Return which modules ``command`` needs and are missing, for its help; '' where it can run."""
    missing = [module for module in NEEDED.get(command, ()) if find_spec(module) is None]
    return f' (not here: needs {", ".join(missing)})' if missing else ''


if __name__ == '__main__':
    sys.exit(program())
