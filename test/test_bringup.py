"""Tests that `tactile bringup` produces its results and explains every failure in one sentence."""

import gzip
from pathlib import Path

import pytest
from candump import DATA

from tactile_node.cli.main import main
from tactile_node.package_files import config_path
from tactile_node.ros.parameter_sections import section_warnings
from tactile_node.sources.log_source import UNREAD_EXIT

pytestmark = [pytest.mark.ros, pytest.mark.bus]


LOG = str(DATA / 'sim16x16_two_pads.log.gz')
SYNCS = 25


@pytest.fixture(scope='module')
def lines():
    """Return the lines of LOG before SYNC number SYNCS + 1."""
    lines = gzip.decompress(Path(LOG).read_bytes()).splitlines(keepends=True)
    return lines[:[number for number, line in enumerate(lines) if b' 080#' in line][SYNCS]]


@pytest.fixture
def log(lines, tmp_path):
    path = tmp_path / 'short.log'
    path.write_bytes(b''.join(lines))
    return path


def test_a_log_comes_out_whole_and_the_command_reports_it(lines, log, capsys):
    assert main(['bringup', '--replay', str(log), '--pace', '0', '--pads', 'left,right', '--node-id', '32,64']) == 0
    printed = capsys.readouterr().out
    assert f'Shapes: {2 * SYNCS} of {2 * SYNCS} taxel frames' in printed
    assert f'CAN frames: {len(lines)} ' in printed


def test_a_replay_starts_whatever_the_parameter_file_has_and_its_exit_code_reports_an_unread_line(
        log, tmp_path, capsys):
    with log.open('ab') as file:
        file.write(b'(1.0) can0 1A0#0\n')
    parameters = tmp_path / 'parameters.yaml'
    parameters.write_text('/**:\n  ros__parameters:\n    autostart: false\n')
    assert main(['bringup', '--replay', str(log), '--pace', '0', '--params-file', str(parameters)]) == UNREAD_EXIT
    printed = capsys.readouterr().out
    assert 'Shapes: ' in printed and 'lines unread: 1' in printed


@pytest.fixture
def short_timeout(tmp_path):
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**:\n  ros__parameters:\n    boot_timeout: 0.3\n')
    return ['--params-file', str(file)]


@pytest.mark.parametrize('words, expected', [
    (['--replay', '/nowhere.log'], 'no such file'),
    (['--interface', 'virtual', '--eds', __file__], 'expected an EDS file'),
    (['--interface', 'virtual', '--channel', 'empty', '--wait-at-start', 'false'],
     'Check power, wiring, termination, bit rate and node-ID'),
    (['--interface', 'slcn'], 'got \'slcn\'. Did you mean "slcan"?'),
    # Waiting for an interface that does not exist would not help, so the command must end at once.
    (['--interface', 'nosuch'], ', socketcan, '),
    (['--interface', 'virtual', '--layout', '/nowhere.yaml'], '/nowhere.yaml'),
    (['--interface', 'virtual', '--pads', 'left,right'], "one for each of the pads' nodes"),
    (['--interface', 'virtual', '--pads', 'left right', '--node-id', '32,64'], 'Commas separate several pads'),
    (['--interface', 'virtual', '--pads', 'le-ft'], 'letters, digits and underscores'),
    (['--interface', 'virtual', '--namespace', 'my-robot'], "got 'my-robot'. Rename it"),
    (['--interface', 'virtual', '--ros-args', '-r', '__ns:=/my-robot'], "got '/my-robot'. Rename it"),
    (['--interface', 'virtual', '--bitrate', '5'], 'bit rate of the bus [bit/s]'),
    (['--interface', 'virtual', '--pads', 'left,right', '--node-id', '32,64', '--gap', '40'],
     "'gap': expected opening of the gripper with gap_source parameter [m]"),
    (['--interface', 'virtual', '--pads', 'left,left', '--node-id', '32,64'], 'a different name for each'),
    (['--replay', LOG, '--record', '/nowhere.log'], 'a replay cannot be recorded'),
    (['--replay', LOG, '--side', 'bus'], 'all nodes of the bus in one process'),
    (['--use-sim-time', 'maybe'], 'true or false'),
    (['--interface', 'virtual', '--publish-clock', 'true'], 'publish_clock'),
    (['--end-with', 'launch'], '--end-with: expected a whole number >= 1'),
    (['--interface', 'virtual', '--node-id', 'one'], 'whole number'),
])
def test_invalid_arguments_end_with_one_sentence_and_code_2(words, expected, short_timeout, capsys):
    assert main(['bringup', *short_timeout, *words]) == 2
    error = capsys.readouterr().err.strip()
    assert error.startswith('tactile: error: ') and '\n' not in error
    assert expected in error


@pytest.mark.parametrize('rule', ['-r', pytest.param('--remap', marks=pytest.mark.long)])
def test_a_namespace_for_the_whole_process_keeps_the_names_of_its_nodes(rule):
    """Inside PushRosNamespace, launch_ros passes the node name and namespace as remapping arguments.

    Without special handling, rcl would name both processors /robot/hand/processor.
    """
    from tactile_node.cli.bringup import describe_nodes
    from tactile_node.cli.main import _parser
    from tactile_node.nodes.run import running
    from tactile_node.ros.global_names import without_global_names
    args = _parser('bringup').parse_args(
        ['bringup', '--pads', 'left,right', '--node-id', '32,64', '--namespace', 'elsewhere', '--ros-args', rule,
         '__node:=one', '--ros-args', rule, '__ns:=/robot/hand', rule, 'grasp:=held', '-p', 'queue_depth:=7'])
    given = without_global_names(args.ros_args)
    with running(describe_nodes(args, given.namespace), given.arguments) as (system, _):
        assert [node.get_fully_qualified_name() for node in system.nodes] == [
            '/robot/hand/' + name for name in ('left/processor', 'left/classifier', 'right/processor',
                                               'right/classifier', 'grasp', 'skin_driver')]
        assert {node.get_parameter('queue_depth').value for node in system.nodes} == {7}
        published = {publisher.topic_name for node in system.nodes for publisher in node.publishers}
        assert {'/robot/hand/left/shape', '/robot/hand/right/shape', '/robot/hand/held'} <= published
        # `tactile bringup` keeps the driver's default for wait_at_start.
        assert system.driver.get_parameter('wait_at_start').value is True


def test_frames_have_the_given_names_and_prefix(tmp_path):
    from tactile_node.nodes.driver_source import pad_frames
    from tactile_node.ros.settings import DriverSettings, GraspNodeSettings
    from tactile_node.skin.pads import make_pads
    pads = make_pads(['sim16x16.yaml'] * 2, [32, 64], ['left', 'right'])
    assert pad_frames(DriverSettings(), pads) == ['left_pad', 'right_pad']
    assert pad_frames(DriverSettings(frame_ids=('l', ''), frame_prefix='robot1/'), pads) == [
        'robot1/l', 'robot1/right_pad']
    assert GraspNodeSettings(frame_prefix='robot1/').frame == 'robot1/gripper'


@pytest.mark.parametrize('value', ['[]', 'soon'])
def test_a_wrong_value_for_a_parameter_of_ros_ends_with_a_sentence(value, tmp_path, capsys):
    file = tmp_path / 'parameters.yaml'
    file.write_text(f'/**:\n  ros__parameters:\n    use_sim_time: {value}\n')
    assert main(['bringup', '--interface', 'virtual', '--params-file', str(file)]) == 2
    error = capsys.readouterr().err.strip()
    assert error.startswith('tactile: error: ') and '\n' not in error and 'use_sim_time' in error


def test_two_parameter_files_are_both_used_and_the_later_one_wins(tmp_path):
    from tactile_node.cli.bringup import _params_files, describe_nodes
    from tactile_node.cli.main import _parser
    from tactile_node.nodes.run import running
    files = [tmp_path / name for name in ('mine.yaml', 'measured.yaml')]
    for file, values in zip(files, ('sync_period: 0.07, heartbeat_timeout: 3.0', 'heartbeat_timeout: 4.0')):
        file.write_text(f'/**/skin_driver: {{ros__parameters: {{{values}}}}}\n')
    args = _parser('bringup').parse_args(['bringup', '--params-file', str(files[0]), '--params-file', str(files[1])])
    with running(describe_nodes(args, ''), _params_files(args)) as (system, _):
        assert [system.driver.get_parameter(name).value for name in ('sync_period', 'heartbeat_timeout')] == [0.07, 4.0]


@pytest.mark.parametrize(('words', 'says'), [
    (['--node_ids', '32'], 'Write --node-ids.'), (['interface:=slcan'], 'Write --interface=slcan.'),
    (['--sync-period', '0.05'], '--ros-args -p NAME:=VALUE'), (['nonsense'], 'arguments: nonsense.\n')])
def test_an_option_in_the_spelling_of_a_launch_argument_is_refused_with_its_spelling(words, says, capsys):
    with pytest.raises(SystemExit) as ended:
        main(['bringup', *words])
    assert ended.value.code == 2 and says in capsys.readouterr().err


@pytest.mark.parametrize(('text', 'says'), [
    ('/**/skin_drvier: {ros__parameters: {sync_period: 0.05}}', "Did you mean 'skin_driver'?"),
    ('hand: {left: {skin_processor: {ros__parameters: {queue_depth: 1}}}}', "'hand/left/skin_processor'"),
    ('/**/talker: {ros__parameters: {rate: 1}}', 'The nodes are skin_driver, '),
    ('# nothing', 'sets no parameter'), ('/**/skin_driver: {sync_period: 0.05}', 'sets no parameter')])
def test_a_section_that_no_node_reads_is_reported(text, says, tmp_path):
    file = tmp_path / 'parameters.yaml'
    file.write_text(text)
    warning, = section_warnings(str(file))
    assert says in warning


def test_sections_of_every_node_of_this_package_are_known(tmp_path):
    assert not section_warnings(str(config_path('parameters.yaml'))) and not section_warnings('/nowhere.yaml')
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**: {ros__parameters: {use_sim_time: true}}\n/hand/*: {ros__parameters: {queue_depth: 1}}\n'
                    'left: {touch_gripper: {ros__parameters: {joint: finger}}}')
    assert not section_warnings(str(file))


@pytest.mark.parametrize('option', ['--params-file', '--ros-args'])
def test_a_misspelt_section_is_reported_at_the_start(option, tmp_path, caplog):
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**/skin_drvier: {ros__parameters: {sync_period: 0.05}}')
    words = [option, *['--params-file'] * (option == '--ros-args'), str(file)]
    assert main(['bringup', '--interface', 'nosuch', *words]) == 2
    assert 'skin_drvier' in caplog.text


def test_a_missing_parameter_file_is_reported(capsys):
    assert main(['bringup', '--interface', 'virtual', '--params-file', '/nowhere.yaml']) == 2
    assert 'a ROS 2 parameter file' in capsys.readouterr().err


def test_a_parameter_that_cannot_work_is_refused_at_once():
    import rclpy
    from rclpy.parameter import Parameter

    from tactile_node.nodes.processor_node import ProcessorNode
    rclpy.init()
    try:
        node = ProcessorNode()
        results = node.set_parameters([Parameter('release_ratio', value=0.0), Parameter('features', value=['nosuch'])])
        assert [result.successful for result in results] == [False, False]
        assert node.set_parameters([Parameter('features', value=['all'])])[0].successful
        node.destroy_node()
    finally:
        rclpy.shutdown()
