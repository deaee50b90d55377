"""Stand-ins for `launch` and `launch_ros`, which are not on PyPI.

The stand-ins record which processes the launch file would start.
"""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType

from tactile_node.cli.bringup import describe_nodes
from tactile_node.cli.main import _parser


class Recorded:
    """Stand-in for a class of `launch` or `launch_ros` that keeps its arguments."""

    def __init__(self, *given, **named):
        self.given, self.named = given, named


class Configuration(Recorded):
    def perform(self, context):
        return context[self.given[0]]


class Context(dict):
    """Stand-in for a launch context. The items of this dictionary are the launch configurations."""

    @property
    def launch_configurations(self):
        return self


MODULES = {
    'launch': ['LaunchDescription'], 'launch.action': ['Action'],
    'launch.actions': ['DeclareLaunchArgument', 'LogInfo', 'OpaqueFunction', 'Shutdown'], 'launch.events': [],
    'launch.events.process': ['ProcessExited'], 'launch.launch_context': ['LaunchContext'],
    'launch.substitutions': ['LaunchConfiguration'], 'launch_ros': [], 'launch_ros.actions': ['Node']}


def put_stand_ins(monkeypatch):
    """Replace the modules of launch with stand-ins."""
    for name, classes in MODULES.items():
        module = ModuleType(name)
        for each in classes:
            base = Configuration if each == 'LaunchConfiguration' else Recorded
            setattr(module, each, type(each, (base,), {}))
        monkeypatch.setitem(sys.modules, name, module)


def declared(path):
    """Return the arguments that a launch file declares, and the function that makes its actions."""
    spec = spec_from_file_location(path.name.replace('.', '_'), path)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    *found, function = module.generate_launch_description().given[0]
    assert {type(each).__name__ for each in found} == {'DeclareLaunchArgument'}
    return found, function.named['function']


def actions_of(path, given):
    """Return the launch file's actions for the launch configurations in ``given``, including inherited ones."""
    found, function = declared(path)
    return function(Context({each.given[0]: each.named['default_value'] for each in found} | given))


def process_of(path, **given):
    """Return the `tactile bringup` process, which must be the only process that the launch file starts."""
    process, = processes_of(path, **given)
    return process


def processes_of(path, **given):
    """Return the processes that the launch file starts, with bringup first."""
    found, _ = declared(path)
    defaults = {each.given[0]: each.named['default_value'] for each in found}
    assert given.keys() <= defaults.keys()
    for each in found:
        choices = each.named.get('choices')
        assert not choices or given.get(each.given[0], each.named['default_value']) in choices
    actions = actions_of(path, given)
    assert {type(action).__name__ for action in actions} == {'Node'}
    assert {action.named['package'] for action in actions} == {'tactile_skin'}
    assert actions[0].named['executable'] == 'tactile'
    return [action.named for action in actions]


def nodes_of(process, namespace=''):
    """Describe the nodes that a process would start, parsing its arguments as the real command does."""
    return describe_nodes(_parser('bringup').parse_args(process['arguments']), namespace)
