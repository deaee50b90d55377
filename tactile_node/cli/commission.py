"""`tactile commission` measures a gripper and its two pads on the desk, and writes their parameters.

    tactile commission --output hand --joint finger_joint --unit m --limits 0 0.04 --most-effort 40
    tactile commission --output hand            # continues after the last finished step
    tactile commission --output hand --check    # later, about 2.5 minutes: has anything changed?

The command asks you for each action, and moves the gripper after your consent (docs/commissioning.md). It needs a
running driver of both pads, the gripper's own action (ParallelGripperCommand) and joint states. Ctrl-C stops the
gripper. After each step, the command prints the values that the step has found. The folder of --output gets the results
of each step (record.json), the parameters (parameters.yaml) and the report (report.md, report.json). The exit code is 1
if a step was refused, or if --check finds a change; 2 if an option, the driver or the gripper has to be corrected
first, and after the recordings of --disc and --shapes; 130 after Ctrl-C.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from datetime import datetime
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import tactile_node
from tactile_node.cli.commissioning_pictures import pictures_of
from tactile_node.cli.options import add_number, names, number, pad_names
from tactile_node.commissioning.changes import COMPARED, find_changes
from tactile_node.commissioning.commissioned_gripper import Question
from tactile_node.commissioning.commissioning_record import CommissioningRecord, plan_from
from tactile_node.commissioning.evaluation import Evaluation
from tactile_node.commissioning.mistake import RefusedStepError
from tactile_node.commissioning.parameter_file import measured_parameters, write_parameters
from tactile_node.commissioning.plan import CommissioningPlan, GaugeBlock
from tactile_node.commissioning.procedure import OPTIONAL, CommissioningProcedure
from tactile_node.commissioning.recording import PadGrid
from tactile_node.commissioning.report import found_lines, write_report
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.interruption import interrupted_once
from tactile_node.output_file import output_file

if TYPE_CHECKING:
    from tactile_node.gripper.ros_gripper import RosGripper

GRAVITY = 9.81       #: [m/s²]
DEFAULT_PADS = ['left', 'right']  #: names of the pads without --pads
CHECK_REST = 20.0    #: duration of the recording of the untouched pads in a check [s]
CHECK_TRIALS = 3     #: number of trials of each way to stop in a check
RESULTS = 'parameters.yaml', 'report.md', 'report.json', 'check.json'  #: files beside the record
REFUSED_CODE = 1     #: exit code after a refused step or a change
DOWN = {'base': (0.0, -1.0), 'tip': (0.0, 1.0), 'left': (-1.0, 0.0), 'right': (1.0, 0.0)}
SAFETY = '''
The gripper will move. This program is not a safety function (ISO 13849, ISO 10218).
  - Keep the emergency stop within your reach, and fix the gripper so that the arm cannot move.
  - Before each series of movements, the program states the target, the speed, the effort and the force. The target is
    a position of the joint. The effort is in the unit of the gripper.
  - Until the first movement is done, the program does not know which direction opens the gripper.
  - Press Ctrl-C to stop: the program cancels all goals, and commands the present position.
'''


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('-o', '--output', required=True, metavar='FOLDER', help='folder for all files; a record in '
                        'this folder is continued')
    parser.add_argument('--check', action='store_true', help='repeat rest, presses, first movement and a few stops, '
                        'and compare them with the record')
    gripper = parser.add_argument_group('gripper', 'The data sheet has these values. The first run needs them; later '
                                        'runs take them from the record.')
    gripper.add_argument('--joint', help='name of the joint in the joint states and in the goals')
    gripper.add_argument('--unit', choices=('m', 'rad', 'percent'), help='unit of the joint')
    gripper.add_argument('--limits', nargs=2, type=float, metavar=('LOW', 'HIGH'), help='limits of the joint')
    add_number(gripper, '--most-effort', limits={'above': 0}, metavar='EFFORT', help='largest effort that the '
               'gripper accepts, in its own unit')
    add_number(gripper, '--force-limit', limits={'above': 0, 'unit': 'N'}, metavar='N', help='largest force that the '
               'commissioning applies on purpose [N] (default: 20)')
    tools = parser.add_argument_group('tools and durations')
    tools.add_argument('--blocks', type=names, metavar='WIDTH:LENGTH,...', help='width of each gauge block, and '
                       'length of its faces [m] (default: 0.010:0.022,0.025:0.018,0.040:0.014)')
    add_number(tools, '--weight', limits={'above': 0, 'unit': 'kg'}, metavar='KG', help='mass of the weight [kg] '
               '(default: 0.5)')
    tools.add_argument('--jig', type=names, metavar='X,Y,Z[,ROLL,PITCH,YAW]', help='place of the block in the jig, in '
                       'the frame of the gripper [m], and the angles of the jig [rad] (default: no jig, so the poses '
                       'of the pads are relative only). A later run may state another place')
    tools.add_argument('--down', choices=DOWN, help='direction of gravity on the left pad, seen with the fingertip up '
                       '(default: base)')
    add_number(tools, '--rest-time', limits={'least': 10, 'unit': 's'}, metavar='S', help='duration of the recording '
               'of the untouched pads [s] (default: 300)')
    add_number(tools, '--hold-time', limits={'least': 5, 'unit': 's'}, metavar='S', help='time for which the force on '
               'the foam is recorded without commands [s] (default: 60)')
    add_number(tools, '--stop-trials', int, limits={'least': 3}, metavar='N', help='number of trials of each way to '
               'stop (default: 20)')
    tools.add_argument('--skip', type=names, default=[], metavar='STEP,...', help='steps to leave out: '
                       'foam, block, jig, step, weight, proof. Steps that need them are left out too, and the values '
                       'of all these steps are missing')
    skin = parser.add_argument_group('skin', 'Nothing may touch the pad when a recording begins.')
    add_number(skin, '--disc', limits={'above': 0, 'unit': 'm'}, metavar='RADIUS', help='press a flat disc of this '
               'radius [m] for `tactile calibrate`, before the gripper moves (default: left out)')
    skin.add_argument('--shapes', type=names, default=[], metavar='NAME,...', help='touch the pad with these objects '
                      'for `tactile assess`, for example circle,bar,unknown (default: left out)')
    topics = parser.add_argument_group('topics')
    topics.add_argument('--action', default='gripper_controller/gripper_cmd', metavar='NAME', help="gripper's own "
                        'action (default: %(default)s)')
    topics.add_argument('--joint-states', default='joint_states', metavar='TOPIC', help='topic of the joint states '
                        '(default: %(default)s)')
    topics.add_argument('--pads', type=pad_names, metavar='NAME,NAME', help='names of the '
                        'two pads (default: left,right)')
    topics.add_argument('--namespace', default='', help='namespace of the driver and of the gripper')


def run(args: argparse.Namespace) -> int:
    """Commission the gripper or check it. Return 0, or REFUSED_CODE after a refused step or a change."""
    _check_options(args)
    folder = Path(args.output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f'folder {args.output!r}', expected='a folder', got=str(error),
                         remedy='Give another folder.') from error
    _check_folder(folder)
    record = CommissioningRecord(folder / 'record.json')
    stated = _stated(args, record)
    person = Terminal(sys.stdin, sys.stdout)
    if args.check:
        _check_record(record, folder)
    person.say(f'{SAFETY}\nConnecting to the gripper and the pads ...')
    with interrupted_once(), _connected(args, stated['joint'], stated.get('pads', DEFAULT_PADS)) as (gripper, grid):
        plan = _plan(args, record, grid)
        if args.check:
            return _check(gripper, person, plan, record, folder)
        if args.disc or args.shapes or 'response' in record:
            from tactile_node.cli.skin_measurement import measure_skin
            if measure_skin(gripper, person, plan.pads[0], record, folder, args.disc, args.shapes):
                _write_results(plan, record, folder, person)
                raise ConfigurationError('driver', expected='the response of the skin', got='none', remedy='Start the '
                                         f'driver with params_file:={folder}/parameters.yaml, then start this command '
                                         'again.')
        return _commission(gripper, person, plan, record, folder, args.skip)


class Terminal:
    """The person at a terminal, who reads each question and types an answer.

    Parameters
    ----------
    answers, texts : TextIO
        Streams from which the answers are read, and to which the texts are written.
    """

    def __init__(self, answers: TextIO, texts: TextIO):
        self._answers, self._texts = answers, texts

    def say(self, text: str) -> None:
        print(text, file=self._texts, flush=True)

    def ask(self, question: Question) -> str:
        """Return the choice that the person types, or the beginning of which the person types.

        Raises
        ------
        KeyboardInterrupt
            Raised if the input has ended (Ctrl-D).
        """
        is_single = len(question.choices) == 1
        prompt = question.act.prompt if is_single else '/'.join(question.choices)
        self.say(f'\n{question.text}')
        if self._answers.isatty():  # an answer that was typed before the question is no consent
            import termios  # a late import, because Windows does not have this module
            termios.tcflush(self._answers, termios.TCIFLUSH)
        while True:
            print(f'  [{prompt}] ', end='', file=self._texts, flush=True)
            line = self._answers.readline()
            if not line:
                raise KeyboardInterrupt
            answer = line.strip().lower()
            found = [choice for choice in question.choices if answer and choice.startswith(answer)]
            if is_single and not answer:
                return question.choices[0]
            if len(found) == 1:
                return found[0]


def _commission(gripper: 'RosGripper', person: Terminal, plan: CommissioningPlan, record: CommissioningRecord,
                folder: Path, skip: Sequence[str]) -> int:
    """Carry out the steps, and write all files even if a step is refused or the person interrupts."""
    is_done = _carry_out(gripper, person, plan, record, skip, 'Start the same command again to carry out these steps.',
                         lambda: _write_results(plan, record, folder, person))
    return 0 if is_done else REFUSED_CODE


def _check(gripper: 'RosGripper', person: Terminal, plan: CommissioningPlan, first: CommissioningRecord,
           folder: Path) -> int:
    """Repeat the steps that a check compares, and print the changes."""
    path = folder / 'check.json'
    path.unlink(missing_ok=True)
    check = CommissioningRecord(path)
    short = replace(plan, rest_time=CHECK_REST, stop_trials=CHECK_TRIALS)
    remedy = 'The record of the commissioning is unchanged. Start the same command again to repeat the whole check.'
    if not _carry_out(gripper, person, short, check, OPTIONAL, remedy):
        return REFUSED_CODE
    found = find_changes(first, check, plan)
    person.say('\n'.join(map(str, found)) or 'No change was found.')
    return REFUSED_CODE if found else 0


def _carry_out(gripper: 'RosGripper', person: Terminal, plan: CommissioningPlan, record: CommissioningRecord,
               skip: Sequence[str], remedy: str, at_end: Callable[[], None] = lambda: None) -> bool:
    """Carry out the steps, and return False if a step was refused.

    At the end, also after an interruption, call ``at_end``. Then print the steps without results, how the procedure has
    stopped the gripper, and the ``remedy``.
    """
    procedure = _procedure(gripper, person, plan, record)
    try:
        procedure.run(skip)
        return True
    except RefusedStepError as error:
        print(f'tactile: error: {error}', file=sys.stderr)
        return False
    finally:
        at_end()
        if steps := procedure.unfinished(skip):
            person.say(f'\nNot finished: {", ".join(steps)}. If the command was moving the gripper, it has cancelled '
                       f'its goals and commanded the present position. {remedy}')


def _procedure(gripper: 'RosGripper', person: Terminal, plan: CommissioningPlan, record: CommissioningRecord
               ) -> CommissioningProcedure:
    said = found_lines(Evaluation(record, plan))

    def say_results(step: str, reason: str) -> None:
        """Print each line that the results of the step have changed."""
        lines = found_lines(Evaluation(record, plan))
        new = [line for line in lines if line not in said]
        said[:] = lines
        person.say('\n'.join([f'\n{step}: {f"nothing found, because {reason}" if reason else "finished"}',
                              *(f'  {line}' for line in new)]))
    return CommissioningProcedure(gripper, person, plan, record, lambda step: person.say(f'\n== {step} =='),
                                  say_results)


def _write_results(plan: CommissioningPlan, record: CommissioningRecord, folder: Path, person: Terminal) -> None:
    found = Evaluation(record, plan)
    parameters = measured_parameters(found, plan)
    if parameters.nodes:  # ROS refuses a file without parameters
        write_parameters(str(folder / 'parameters.yaml'), parameters)
    about = {'date': datetime.now().astimezone().isoformat(timespec='minutes'), 'version': tactile_node.__version__,
             'joint': f'{plan.joint}, {plan.low:g} to {plan.high:g} {plan.unit}'}
    serials = [each or 'unknown' for each in record.serial_numbers]
    about['serial numbers'] = ', '.join(f'pad {pad}: {serial}' for pad, serial in zip(plan.pads, serials))
    pictures = pictures_of(found, plan)
    for file, (_, drawing) in pictures.items():
        with output_file(folder / file) as stream:
            stream.write(drawing.encode())
    write_report(folder / 'report.md', folder / 'report.json', found, parameters, about,
                 {file: caption for file, (caption, _) in pictures.items()})
    written = ['record.json', 'report.md', 'report.json', *['parameters.yaml'] * bool(parameters.nodes)]
    person.say(f'\nWritten to {folder}: {", ".join(written)}.'
               + (f' {len(parameters.absent)} parameters are missing; the report gives the reasons.'
                  if parameters.absent else ''))
    for note in parameters.notes:
        person.say(f'  {note}')


@contextmanager
def _connected(args: argparse.Namespace, joint: str, pads: Sequence[str]) -> Iterator[tuple['RosGripper', PadGrid]]:
    """Connect to the gripper and the pads. At the end, wait until the gripper has answered the last commands."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from tactile_node.gripper.ros_gripper import RosGripper
    from tactile_node.nodes.run import translate_rclpy_errors
    from tactile_node.nodes.spinner import spinning
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        with translate_rclpy_errors():
            node = rclpy.create_node('tactile_commission', namespace=args.namespace)
            gripper = RosGripper(node, action=args.action, joint=joint, joint_states=args.joint_states, pads=pads)
        try:
            with spinning([node]):
                try:
                    yield gripper, gripper.connect()
                finally:
                    if not gripper.settle():
                        print('tactile: the gripper has not answered the last command. Check that it stands still.',
                              file=sys.stderr)
        finally:
            gripper.destroy()
            node.destroy_node()
    finally:
        rclpy.try_shutdown()


def _check_options(args: argparse.Namespace) -> None:
    if not sys.stdin.isatty():
        raise ConfigurationError('standard input', expected='a terminal, because a person has to watch the gripper',
                                 got='a file or a pipe', remedy='Start the command in a terminal, without "<" or "|".')
    if args.pads and len(set(args.pads)) != 2:
        raise ConfigurationError('--pads', expected='two names', got=', '.join(args.pads),
                                 remedy='Give, for example, --pads left,right.')
    if args.jig:
        _jig(args.jig)
    if wrong := [step for step in args.skip if step not in OPTIONAL]:
        raise ConfigurationError('--skip', expected=f'one of {", ".join(OPTIONAL)}', got=', '.join(wrong),
                                 remedy='All other steps are needed.')


def _check_folder(folder: Path) -> None:
    """Refuse a folder with files that no commissioning has written, because the command would overwrite them."""
    present = [name for name in RESULTS if (folder / name).exists()]
    if present and not (folder / 'record.json').exists():
        raise InputError(f'folder {str(folder)!r}', expected='a new folder, or the record.json of a commissioning',
                         got=', '.join(present), remedy='Give another folder.')


def _check_record(record: CommissioningRecord, folder: Path) -> None:
    if missing := [step for step in COMPARED if step not in record]:
        raise ConfigurationError(f'{folder}/record.json', expected=f'the steps {", ".join(COMPARED)}',
                                 got=f'no {", ".join(missing)}', remedy='Commission the gripper first.')


def _stated(args: argparse.Namespace, record: CommissioningRecord) -> dict[str, Any]:
    """Return the fields of the plan that the options and the record state.

    Raises
    ------
    ConfigurationError
        Raised if an option is missing, or if it differs from the record.
    """
    low, high = args.limits or (None, None)
    options = {
        'joint': ('--joint', args.joint), 'unit': ('--unit', args.unit), 'low': ('--limits', low),
        'high': ('--limits', high), 'most_effort': ('--most-effort', args.most_effort),
        'force_limit': ('--force-limit', args.force_limit),
        'blocks': ('--blocks', args.blocks and [asdict(_block(each)) for each in args.blocks]),
        'weight': ('--weight', args.weight and GRAVITY * args.weight),
        'down': ('--down', args.down and list(DOWN[args.down])), 'rest_time': ('--rest-time', args.rest_time),
        'hold_time': ('--hold-time', args.hold_time), 'stop_trials': ('--stop-trials', args.stop_trials),
        'pads': ('--pads', args.pads)}
    given = {name: value for name, (_, value) in options.items() if value is not None}
    if kept := record['plan']:
        for name, value in given.items():
            if value != kept.get(name, DEFAULT_PADS):
                raise ConfigurationError(options[name][0], expected=f'{kept[name]} as in the record', got=str(value),
                                         remedy='Give another --output for another gripper or plan.')
        return kept
    if missing := [options[name][0] for name in ('joint', 'unit', 'low', 'most_effort') if name not in given]:
        raise ConfigurationError('first run of the commissioning', expected=', '.join(missing), got='none',
                                 remedy='The data sheet of the gripper has these values (`tactile commission --help`).')
    return given


def _plan(args: argparse.Namespace, record: CommissioningRecord, grid: PadGrid) -> CommissioningPlan:
    """Return the plan from the record, or save the plan of the first run there."""
    stated = _stated(args, record)
    blocks = [asdict(_block(each)) for each in ('0.010:0.022', '0.025:0.018', '0.040:0.014')]
    plan = plan_from({'blocks': blocks, 'weight': GRAVITY / 2, 'down': DOWN['base'], 'grid': grid} | stated)
    if args.jig:
        plan = replace(plan, jig=_jig(args.jig))
    if plan.grid != grid:
        raise ConfigurationError('pads', expected=f'{plan.grid} as in the record', got=str(grid),
                                 remedy='Give another --output for other pads.')
    if 'plan' not in record or list(plan.jig) != record['plan'].get('jig', []):
        record.save('plan', asdict(plan))
    return plan


def _jig(values: Sequence[str]) -> tuple[float, ...]:
    found = tuple(number(each, '--jig', least=-inf, remedy='For example 0,0,0.12.') for each in values)
    if len(found) not in (3, 6):
        raise ConfigurationError('--jig', expected='x, y, z [m], and optionally roll, pitch, yaw [rad]',
                                 got=f'{len(found)} numbers', remedy='For example 0,0,0.12.')
    return (*found, 0.0, 0.0, 0.0)[:6]


def _block(text: str) -> GaugeBlock:
    width, _, length = text.partition(':')
    return GaugeBlock(*(number(each, '--blocks', above=0, unit='m', remedy='For example 0.010:0.022.')
                        for each in (width, length)))
