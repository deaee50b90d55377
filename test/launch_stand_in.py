"""Stand-ins for `launch` and `launch_ros`, which are not on PyPI: they show what the launch files would start."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType, SimpleNamespace

from tactile_node.cli.bringup_nodes import described
from tactile_node.cli.main import _parser

SHARED = 'tactile_node.launching.processes'


class Recorded:
    """Stands for a class of `launch` or `launch_ros`: what it is made with is kept."""

    def __init__(self, *given, **named):
        self.given, self.named = given, named


class Configuration(Recorded):
    def perform(self, context):
        return context[self.given[0]]


class Logger:
    def __init__(self):
        self.errors = []

    def get_logger(self, name):
        return SimpleNamespace(error=self.errors.append)


MODULES = {
    'launch': [], 'launch.logging': [], 'launch.action': ['Action'], 'launch.event_handlers': ['OnProcessExit'],
    'launch.actions': ['DeclareLaunchArgument', 'EmitEvent', 'GroupAction', 'IncludeLaunchDescription',
                       'OpaqueFunction', 'RegisterEventHandler'],
    'launch.events': ['Shutdown'], 'launch.substitutions': ['LaunchConfiguration'],
    'launch.launch_context': ['LaunchContext'], 'launch.launch_description': ['LaunchDescription'],
    'launch.launch_description_sources': ['PythonLaunchDescriptionSource'], 'launch_ros': [],
    'launch_ros.actions': ['Node']}


def put_stand_ins(monkeypatch):
    """Put stand-ins in the place of launch; returns the errors that it is given to log."""
    logger = Logger()
    for name, classes in MODULES.items():
        module = ModuleType(name)
        for each in classes:
            base = Configuration if each == 'LaunchConfiguration' else Recorded
            setattr(module, each, type(each, (base,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    sys.modules['launch'].logging = sys.modules['launch.logging']
    sys.modules['launch'].LaunchDescription = sys.modules['launch.launch_description'].LaunchDescription
    sys.modules['launch.logging'].get_logger = logger.get_logger
    monkeypatch.setitem(sys.modules, SHARED, None)  # so that the present one is back after the test
    del sys.modules[SHARED]
    return logger.errors


def declared(path):
    """What a launch file declares, and the function that it calls then."""
    spec = spec_from_file_location(path.name.replace('.', '_'), path)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    *found, function = module.generate_launch_description().given[0]
    assert {type(each).__name__ for each in found} == {'DeclareLaunchArgument'}
    return found, function.named['function']


def actions(path, **given):
    """What a launch file starts: its actions, those of included files in the place of their inclusion."""
    found, function = declared(path)
    defaults = {each.given[0]: each.named['default_value'] for each in found}
    assert given.keys() <= defaults.keys()
    for each in found:
        choices = each.named['choices']
        assert not choices or given.get(each.given[0], each.named['default_value']) in choices
    return list(_flat(function(defaults | given)))


def _flat(found):
    for action in found:
        kind = type(action).__name__
        if kind == 'GroupAction':
            yield from _flat(action.given[0])
        elif kind == 'IncludeLaunchDescription':
            yield from actions(Path(action.given[0].given[0]), **dict(action.named['launch_arguments']))
        else:
            yield action


def processes(path, **given):
    """What the launch starts."""
    found = [action.named for action in actions(path, **given) if type(action).__name__ == 'Node']
    assert all(each['package'] == 'tactile_skin' and each['executable'] == 'tactile' for each in found)
    return found


def nodes_of(process, namespace=''):
    """The nodes that the process makes, by the real command's own reading of its arguments."""
    return described(_parser('bringup').parse_args(process['arguments']), namespace)
