# PYTHON_ARGCOMPLETE_OK
"""The `tactile` program: run a sub-command, and print each error of this package on one line."""

import argparse
import logging
import os
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec

import tactile_node
from tactile_node.errors import TactileError
from tactile_node.interruption import ignore_interruptions

#: Name and help of each sub-command. The first FIRST_COMMANDS commands are listed in the order in which a new user
#: needs them. The module with the name of the sub-command contains ``add_options`` and ``run``, and is imported only
#: for this sub-command.
COMMANDS = (
    ('simulate', 'simulate a CANopen skin that shapes touch in turn'),
    ('scan', 'find the CANopen nodes of a bus'),
    ('draft', 'draft a skin layout from an EDS'),
    ('check', 'check a skin layout and its EDS, and show the pad'),
    ('bringup', 'run all ROS 2 nodes of one bus in this process'),
    ('view', 'show the pads in a browser or on a terminal'),
    ('tare', 'set the zero of the pads of a running driver'),
    ('record', 'record a CAN log from a live bus'),
    ('replay', 'play a CAN log without ROS, and write its taxel frames to a file'),
    ('classify', 'recognise the shape in frames from files, as JSON lines'),
    ('report', 'write a page about a log or bag, for a support ticket'),
    ('features', 'compute every quantity of the paper for frames from files, as JSON lines'),
    ('calibrate', "measure a skin's response with presses of a known disc"),
    ('teach', 'teach the recogniser your own shapes'),
    ('assess', 'report how reliable recognition is on your own skin, and adapt the model'),
    ('commission', 'measure a gripper and its pads on the desk, and write its parameters'),
    ('sdo', 'read or write one object of a device'),
)
FIRST_COMMANDS = 11

#: Command that runs ROS nodes. The nodes forward log messages to /rosout and stderr, so `tactile` adds no handler.
RUNS_NODES = 'bringup'

#: Modules without which a command is of no use. The help text lists the missing ones.
NEEDED = {'simulate': ('termios',), 'bringup': ('rclpy', 'tactile_skin'), 'view': ('viser',),
          'tare': ('rclpy', 'tactile_skin'), 'commission': ('rclpy', 'tactile_skin', 'control_msgs')}
_ROS = 'Source a ROS 2 workspace that contains tactile_skin, or run `make setup` once.'
#: Remedies for missing modules, by module name.
NEEDS = {'rclpy': _ROS, 'rcl_interfaces': _ROS, 'tactile_skin': _ROS,
         'can': 'Install it: pip install python-can.', 'canopen': 'Install it: pip install canopen (docs/install.md).',
         'jinja2': 'Install it: pip install jinja2.',
         'termios': 'Python has this module only on Linux and macOS. Run the command there.',
         'matplotlib': "Install it: pip install 'tactile-skin[picture]'.",
         'viser': "Install it: pip install 'tactile-skin[view]'.",
         'PIL': "Install Pillow: pip install 'tactile-skin[picture]'.",
         'argcomplete': "Install it: pip install 'tactile-skin[completion]'."}

#: Environment variable that the shell sets when it requests completions. Its value is the number of words that form the
#: program name.
COMPLETES = '_ARGCOMPLETE'


def main(argv: list[str] | None = None) -> int:
    """Run `tactile`.

    Parameters
    ----------
    argv : list[str] or None
        Arguments without the program name, or None for the arguments of the process.

    Returns
    -------
    int
        Exit code of the sub-command, 2 after an error, or 130 after Ctrl-C.
    """
    argv = sys.argv[1:] if argv is None else argv
    try:
        parser = _parser(argv[0] if argv else '')
        args, unknown = parser.parse_known_args(argv)
        if unknown:
            parser.error(' '.join((f'unrecognized arguments: {" ".join(unknown)}.',
                                   *other_spellings(unknown, parser.options))))
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
        # The reader (head, less) has closed the pipe. Without this redirection, Python would raise the error again when
        # it flushes stdout at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        return 130


def program() -> int:
    """Run `main` as a process, then ignore Ctrl-C, because an interrupt during shutdown would look like a crash."""
    if COMPLETES in os.environ:
        import argcomplete
        argcomplete.autocomplete(_parser(chosen_command(os.environ)))  # ends the process
    try:
        return main()
    finally:
        ignore_interruptions()


def chosen_command(environment: Mapping[str, str]) -> str:
    """Return the sub-command on the command line, or '' while the user is still typing it.

    >>> chosen_command({'COMP_LINE': 'tactile classify --pi', 'COMP_POINT': '21', '_ARGCOMPLETE': '1'})
    'classify'
    >>> chosen_command({'COMP_LINE': 'tactile cla', 'COMP_POINT': '11', '_ARGCOMPLETE': '1'})
    ''
    """
    line = environment.get('COMP_LINE', '')[:int(environment.get('COMP_POINT') or 0)]
    words = line.split()[int(environment.get('_ARGCOMPLETE') or 1):]
    return words[0] if words and len(line.split(words[0], 1)[1]) else ''


def other_spellings(unknown: Sequence[str], options: Collection[str]) -> list[str]:
    """Return a hint for each unknown argument that names an option of the command in the spelling of a launch argument.

    Parameters
    ----------
    unknown
        Arguments that the command does not know.
    options
        Options of the command.

    Examples
    --------
    >>> other_spellings(['--node_ids', '32', 'interface:=slcan'], ['--node-ids', '--interface'])
    ['Write --node-ids.', 'Write --interface=slcan.']
    >>> other_spellings(['sync_period:=0.05'], ['--interface', '--ros-args'])
    ['Set a parameter that has no option with --ros-args -p NAME:=VALUE or --params-file FILE.']
    """
    hints: dict[str, None] = {}  # in the order of the arguments, each once
    for word in unknown:
        name, sign, value = word.partition(':=' if ':=' in word else '=')
        option = f'--{name.lstrip("-").replace("_", "-")}'
        if option in options:
            hints[f'Write {option}{"=" if sign else ""}{value}.'] = None
        elif '--ros-args' in options and (sign or word.startswith('--')):
            hints['Set a parameter that has no option with --ros-args -p NAME:=VALUE or --params-file FILE.'] = None
    return list(hints)


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
    """Parser whose help lists each command on one line, with the FIRST_COMMANDS first commands in a separate group."""

    options: tuple[str, ...] = ()  #: options of the chosen sub-command

    def format_help(self) -> str:
        lines = [f'    {name:<12}{text}{_lack(name)}' for name, text in COMMANDS]
        return '\n'.join((f'{self.format_usage()}\n{self.description}', '', 'Begin with these commands, in this order:',
                          *lines[:FIRST_COMMANDS], '', 'More:', *lines[FIRST_COMMANDS:],
                          '    --version   print the version', '', f'{self.epilog}', ''))


def _parser(chosen: str) -> _Program:
    """Return the parser for all sub-commands. Only the ``chosen`` sub-command is imported and gets its options."""
    parser = _Program(prog='tactile', description='Recognise contact shapes with a tactile skin on a CAN bus.',
                      epilog='`tactile COMMAND --help` explains a command.')
    version = f'tactile_skin {tactile_node.__version__}' if chosen == '--version' else ''
    parser.add_argument('--version', action='version', version=version)
    commands = parser.add_subparsers(required=True, metavar='COMMAND', parser_class=argparse.ArgumentParser)
    for name, text in COMMANDS:
        command = commands.add_parser(name, help=text)
        if name == chosen:
            module = import_module(f'tactile_node.cli.{name}')
            command.description = module.__doc__
            if '\n' in str(module.__doc__):  # keeps the line breaks of a long description
                command.formatter_class = argparse.RawDescriptionHelpFormatter
            command.set_defaults(run=module.run)
            module.add_options(command)
            parser.options = tuple(command._option_string_actions)
    return parser


def _lack(command: str) -> str:
    """Return a help note on the missing modules that ``command`` needs, or '' if none are missing."""
    missing = [module for module in NEEDED.get(command, ()) if find_spec(module) is None]
    return f' (not available: needs {", ".join(missing)})' if missing else ''


if __name__ == '__main__':
    sys.exit(program())
