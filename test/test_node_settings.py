"""Each parameter of a node is one field of a frozen dataclass.

The field declares the parameter, holds its value, and is replaced when the parameter changes.
"""

import inspect
from dataclasses import FrozenInstanceError, fields
from pathlib import Path
from types import SimpleNamespace

import pytest
import rclpy
import yaml
from candump import DATA
from rcl_interfaces.msg import ParameterType, SetParametersResult
from rcl_interfaces.srv import GetParameters
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy
from ros_bench import TIMEOUT, RosBench

from tactile_node.errors import ConfigurationError
from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.driver_node import READ_AT_CONFIGURE, DriverNode
from tactile_node.nodes.grasp_node import GraspNode
from tactile_node.nodes.processor_node import ProcessorNode
from tactile_node.ros.parameters import changed, read, table
from tactile_node.ros.settings import ClassifierSettings, DriverSettings, GraspNodeSettings, ProcessorSettings

EXAMPLE = Path(__file__).resolve().parents[1] / 'config' / 'parameters.yaml'
SETTINGS = {'skin_driver': DriverSettings, 'processor': ProcessorSettings, 'classifier': ClassifierSettings,
            'grasp': GraspNodeSettings}
NODES = {'skin_driver': DriverNode, 'processor': ProcessorNode, 'classifier': ClassifierNode, 'grasp': GraspNode}
OF_A_CONFIGURATION = {'skin_driver': READ_AT_CONFIGURE}
OF_ROS = {'use_sim_time', 'start_type_description_service'}  # rclpy declares these parameters on every node.


@pytest.fixture(scope='module', params=NODES)
def node(request):
    with rclpy.context.Context() as context:
        node = NODES[request.param](context=context)
        yield node
        node.destroy_node()


def test_a_node_has_the_parameters_that_are_fields_and_no_other(node):
    settings = SETTINGS[node.get_name()]
    declared = set(node.get_parameters_by_prefix('')) - OF_ROS
    assert declared == {field.name for field in fields(settings)} == {row.name for row in table(settings)}


def test_a_node_reads_its_defaults_as_its_settings(node):
    settings = SETTINGS[node.get_name()]
    assert read(node, settings) == settings()


def test_description_range_and_read_only_are_those_of_the_field(node):
    for name, default, (description, low, high, live) in table(SETTINGS[node.get_name()]):
        declared = node.describe_parameter(name)
        assert declared.description == description and len(description) > 10
        assert declared.read_only != (live or name in OF_A_CONFIGURATION.get(node.get_name(), ()))
        if type(default) in (int, float):
            limits, = declared.integer_range or declared.floating_point_range
            assert (limits.from_value, limits.to_value) == (low, high) and low <= default <= high


@pytest.mark.parametrize('settings', SETTINGS.values())
def test_settings_are_frozen_and_a_misspelt_name_is_an_error(settings):
    with pytest.raises(FrozenInstanceError):
        settings().queue_depth = 5
    with pytest.raises(AttributeError):
        settings().queue_deph  # noqa: B018
    assert all(not isinstance(row.default, list) for row in table(settings))


def test_a_change_is_a_new_value_and_leaves_out_parameters_of_ros():
    before = ProcessorSettings()
    after = changed(before, [Parameter('features', value=['all']), Parameter('use_sim_time', value=True)])
    assert after.features == ('all',) and before.features == ('classifier',)
    assert after.press_threshold == before.press_threshold


def test_the_example_file_names_parameters_that_exist_with_values_of_their_type():
    groups = yaml.safe_load(EXAMPLE.read_text(encoding='utf-8'))
    assert {name.removeprefix('/**/') for name in groups} == set(SETTINGS)
    for name, group in groups.items():
        rows = {row.name: row for row in table(SETTINGS[name.removeprefix('/**/')])}
        for parameter, value in group['ros__parameters'].items():
            given = tuple(value) if isinstance(value, list) else value
            assert type(given) is type(rows[parameter].default), parameter


@pytest.mark.parametrize(('given', 'reliability'), [
    ({}, ReliabilityPolicy.RELIABLE), ({'best_effort': True}, ReliabilityPolicy.BEST_EFFORT),
    ({'best_effort': True, 'lossless': True}, ReliabilityPolicy.RELIABLE)])
@pytest.mark.parametrize(('name', 'inputs', 'output'), [
    ('processor', ['taxels'], 'contact'), ('classifier', ['contact'], 'shape'),
    ('grasp', ['left/shape', 'right/shape'], 'grasp')])
def test_best_effort_applies_to_subscriptions_but_never_to_a_lossless_replay(
        name, inputs, output, given, reliability):
    parameters = [Parameter(key, value=value) for key, value in given.items()]
    # Each case has its own namespace, because ROS may still remember the node of the previous case.
    namespace = '_'.join(['given', *given])
    with rclpy.context.Context() as context:
        node = NODES[name](context=context, namespace=namespace, parameter_overrides=parameters)
        received = [info for topic in inputs for info in node.get_subscriptions_info_by_topic(f'/{namespace}/{topic}')]
        sent, = node.get_publishers_info_by_topic(f'/{namespace}/{output}')
        node.destroy_node()
    assert [info.qos_profile.reliability for info in received] == [reliability] * len(inputs)
    assert sent.qos_profile.reliability == ReliabilityPolicy.RELIABLE


@pytest.mark.parametrize('name', ['skin_driver', 'grasp'])
def test_a_node_whose_constructor_has_failed_can_be_destroyed(name, monkeypatch):
    """Since Kilted, a context that shuts down also destroys any node whose constructor has failed.

    Our destroy_node method uses objects that only a complete constructor creates.
    """
    failed = []

    def fails(node, *_):
        failed.append(node)
        raise ValueError
    monkeypatch.setattr(inspect.getmodule(NODES[name]), 'declare', fails)
    with rclpy.context.Context() as context:
        with pytest.raises(ValueError):
            NODES[name](context=context)
        failed[0].destroy_node()


PLACE = 'three finite numbers'
EMPTY = {'pads': 'a name for each pad', 'node_ids': 'one for each of the pads', 'layouts': 'one value, or one for each',
         'left_xyz': PLACE, 'left_rpy': PLACE, 'right_xyz': PLACE, 'right_rpy': PLACE}
LISTS = [(name, row.name) for name, settings in SETTINGS.items() for row in table(settings)
         if isinstance(row.default, tuple)]


def configured(kind, options):
    """Create the node and return it.

    A driver is also configured, and a failed configuration raises its ConfigurationError.
    """
    node = kind(**options)
    try:
        if kind is DriverNode and node.trigger_configure() != TransitionCallbackReturn.SUCCESS:
            raise node._steps.error
        for row in table(SETTINGS[node.get_name()]):
            described = node.describe_parameter(row.name)
            assert described.description == row.properties.description
            assert described.read_only != (row.properties.live
                                           or row.name in OF_A_CONFIGURATION.get(node.get_name(), ()))
        return read(node, SETTINGS[node.get_name()])
    finally:
        node.destroy_node()


@pytest.mark.parametrize(('name', 'parameter'), LISTS, ids=[parameter for _, parameter in LISTS])
def test_an_empty_list_in_a_parameter_file_is_a_list_without_values(name, parameter, tmp_path):
    """ROS reads an empty list as a parameter value without a type. In rclpy, an empty list is a list of bytes."""
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**:\n  ros__parameters:\n    publish_pad_frames: true\n    gap: 0.02\n'
                    f'    replay: {DATA / "sim16x16_two_pads.log.gz"}\n    {parameter}: []\n')
    with rclpy.context.Context() as context:
        given = {'context': context, 'cli_args': ['--ros-args', '--params-file', str(file)]}
        if parameter in EMPTY:
            with pytest.raises(ConfigurationError, match=EMPTY[parameter]):
                configured(NODES[name], given)
        else:
            default = getattr(SETTINGS[name](), parameter)
            read_back = getattr(configured(NODES[name], given), parameter)
            assert read_back == (() if any(default) else default)


@pytest.mark.parametrize(('name', 'parameter'), [('skin_driver', 'bitrate'), ('skin_driver', 'replay'),
                                                 ('processor', 'press_threshold'), ('classifier', 'fuse')])
def test_an_empty_list_for_one_value_is_refused_with_its_meaning(name, parameter, tmp_path):
    file = tmp_path / 'parameters.yaml'
    file.write_text(f'/**:\n  ros__parameters:\n    {parameter}: []\n')
    row, = (row for row in table(SETTINGS[name]) if row.name == parameter)
    with rclpy.context.Context() as context, pytest.raises(ConfigurationError) as refused:
        NODES[name](context=context, cli_args=['--ros-args', '--params-file', str(file)])
    assert (refused.value.where, refused.value.expected) == (f'parameter {parameter!r}', row.properties.description)


def test_an_empty_list_can_be_read_back_over_ros(ros, tmp_path):
    """A single parameter without a type empties the service response and the output of `ros2 param dump`."""
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**:\n  ros__parameters:\n    features: []\n')
    bench = RosBench(ros)
    bench.add(ProcessorNode(cli_args=['--ros-args', '--params-file', str(file)]))
    client = bench.add('reader').create_client(GetParameters, '/processor/get_parameters')
    bench.until(client.service_is_ready)
    call = client.call_async(GetParameters.Request(names=['features', 'queue_depth']))
    bench.until(call.done)
    features, depth = call.result().values
    assert (features.type, features.string_array_value) == (ParameterType.PARAMETER_STRING_ARRAY, [])
    assert depth.integer_value == ProcessorSettings().queue_depth


def drops_incomplete(driver):
    """Return True if the driver's source drops incomplete sweeps, after the chain has applied all changes.

    A stand-in replaces a missing source.
    """
    assert driver._stages.chain.wait_until_idle(TIMEOUT)
    if driver.source is None:
        driver.source = SimpleNamespace(drops=False)
        driver.source.adjust = lambda drops, _timeout: vars(driver.source).update(drops=drops)
    return driver.source.drops


def groups_of(processor):
    """Return the feature groups of the processor, after the chain has applied all changes."""
    assert processor._stages.chain.wait_until_idle(TIMEOUT)
    return processor._groups


CHANGES = {
    'skin_driver': (Parameter('drop_incomplete', value=True), drops_incomplete),
    'processor': (Parameter('features', value=['all']), groups_of),
    'grasp': (Parameter('gap', value=0.02), lambda node: node._opening.current().gap == 0.02)}


@pytest.mark.parametrize('name', CHANGES)
def test_a_change_that_another_callback_refuses_has_no_effect(name):
    """ROS calls all callbacks before it sets a parameter.

    A callback that ROS calls after ours may still refuse the new value.
    """
    refusing, (change, state) = [], CHANGES[name]

    class Refusing(NODES[name]):
        def add_on_set_parameters_callback(self, callback):
            # rclpy calls the callback added last before the others.
            super().add_on_set_parameters_callback(self.answer)
            super().add_on_set_parameters_callback(callback)

        def answer(self, _parameters):
            return SetParametersResult(successful=not refusing, reason='refused by another callback')
    with rclpy.context.Context() as context:
        node = Refusing(context=context)
        before = state(node)
        refusing.append(True)
        assert not node.set_parameters([change])[0].successful
        assert state(node) == before
        refusing.clear()
        assert node.set_parameters([change])[0].successful
        assert state(node) != before
        node.destroy_node()
