"""Tests that the imports of the code match the dependencies in package.xml (rosdep, bloom) and setup.cfg (pip)."""

import ast
import configparser
import re
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import pytest

pytestmark = pytest.mark.filterwarnings('ignore::DeprecationWarning:catkin_pkg', 'ignore::DeprecationWarning:pyparsing')
ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ElementTree.parse(ROOT / 'package.xml')
#: rosdep installs these keys with pip, because neither Ubuntu nor ROS has a package for them.
PIP_KEYS = {'canopen-pip', 'python3-rosbags-pip', 'mcap-ros2-support'}


class Origin(NamedTuple):
    """The rosdep key and the setup.cfg requirement that provide a module.

    ``rosdep`` is None if no key exists, and ``pip`` is None if ROS provides the module.
    """

    rosdep: str | None
    pip: str | None


#: Modules whose rosdep key or pip requirement differs from the module name. For every other module, the rosdep key is
#: the name of the module, and pip does not install the module.
ORIGINS = {
    'argcomplete': Origin('python3-argcomplete', 'argcomplete'),
    'can': Origin('python3-can', 'python-can'),
    'canopen': Origin('canopen-pip', 'canopen'),
    'jinja2': Origin('python3-jinja2', 'jinja2'),
    'markupsafe': Origin('python3-jinja2', 'jinja2'),  # jinja2 requires it.
    'matplotlib': Origin('python3-matplotlib', 'matplotlib'),
    'mcap': Origin('mcap-ros2-support', 'mcap'),
    'numpy': Origin('python3-numpy', 'numpy'),
    'PIL': Origin('python3-pil', 'pillow'),
    'rosbags': Origin('python3-rosbags-pip', 'rosbags'),
    'scipy': Origin('python3-scipy', 'scipy'),
    'serial': Origin('python3-serial', 'pyserial'),
    'tqdm': Origin('python3-tqdm', 'tqdm'),
    'viser': Origin(None, 'viser'),
    'yaml': Origin('python3-yaml', 'pyyaml'),
    'zstandard': Origin('mcap-ros2-support', 'mcap'),  # mcap requires zstandard, which has no rosdep key.
}
OF_TESTS = {'jsonschema': 'python3-jsonschema', 'py_trees': 'py_trees', 'pytest': 'python3-pytest',
            'rosidl_adapter': 'rosidl_default_generators', 'rosidl_generator_py': 'rosidl_default_generators'}
#: Packages that the installed package needs to run, although no code imports them.
NOT_MODULES = {'rosidl_default_runtime', 'ros2launch', 'xacro'}
#: Package whose messages every action contains, although no code imports it.
OF_INTERFACES = {'action_msgs'}
#: rclpy modules that are missing in at least one of Jazzy, Kilted and Lyrical (rclpy 7.1.6, 9.1.2, 10.0.10).
NOT_IN_EVERY_ROS = {f'rclpy.{name}' for name in (
    'destroyable', 'endpoint_info', 'experimental', 'qos_event', 'subscription_content_filter_options',
    'topic_endpoint_info')}
OURS = {'tactile_node', 'tactile_skin', 'bench', 'training', 'examples', 'reference',
        *(path.stem for folder in ('tools', 'bench', 'examples') for path in (ROOT / folder).glob('*.py'))}
#: Modules that only individual tests or examples import. A robot needs them only for such an example, and a developer
#: only for such a test.
OPTIONAL = {'torch', 'catkin_pkg', 'docutils', 'moveit_msgs', 'moveit_configs_utils', 'playwright', 'mujoco',
            'control_msgs', 'lerobot', 'rerun'}


def imported(folder: str) -> dict[str, str]:
    """Map each third-party top-level module imported in ``folder`` to one of the files that import it."""
    found: dict[str, str] = {}
    files = sorted((ROOT / folder).rglob('*.py'))
    names = {path.stem for path in files}
    for path in files:
        for module in modules_of(path):
            found.setdefault(module.partition('.')[0], str(path.relative_to(ROOT)))
    return {name: file for name, file in found.items() if name not in {*sys.stdlib_module_names, *OURS, *names}}


@cache
def modules_of(path: Path) -> tuple[str, ...]:
    """Return the modules that a file imports."""
    return tuple(module for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))) for module in _modules(node))


def _modules(node: ast.AST) -> list[str]:
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom) and not node.level:
        return [node.module]
    if isinstance(node, ast.Call) and getattr(node.func, 'id', getattr(node.func, 'attr', '')) in (
            'import_module', 'find_spec', '_library') and node.args and isinstance(node.args[0], ast.Constant):
        return [node.args[0].value]
    return []


def test_no_module_is_imported_that_a_supported_ros_has_not():
    for path in [*(ROOT / 'tactile_node').rglob('*.py'), *(ROOT / 'examples').rglob('*.py')]:
        assert not {'.'.join(module.split('.')[:2]) for module in modules_of(path)} & NOT_IN_EVERY_ROS, path


def keys(*tags: str) -> set[str]:
    return {element.text for tag in tags for element in PACKAGE.iter(tag)}


def requirements() -> set[str]:
    setup = configparser.ConfigParser()
    setup.read(ROOT / 'setup.cfg')
    texts = [setup['options']['install_requires'], *setup['options.extras_require'].values()]
    return {re.match(r'[\w-]+', line)[0] for text in texts for line in text.strip().splitlines()}


INSTALLED = {**imported('tactile_node'), **imported('launch')}


@pytest.mark.parametrize('module', sorted(INSTALLED))
def test_each_imported_module_is_a_dependency(module):
    """Without the dependency, the program fails with a ModuleNotFoundError on a robot that rosdep or pip has set up."""
    origin = ORIGINS.get(module, Origin(module, None))
    where = f'{module}, which {INSTALLED[module]} imports'
    assert origin.rosdep is None or origin.rosdep in keys('depend', 'exec_depend'), where
    assert origin.pip is None or origin.pip in requirements(), where


@pytest.mark.slow
@pytest.mark.parametrize('folder', ['test', 'examples'])
def test_each_module_that_tests_and_examples_import_is_a_dependency(folder):
    """The dependencies of training and benchmarks are listed separately, in requirements/bench.in."""
    known = keys('depend', 'exec_depend', 'test_depend', 'buildtool_depend')
    for module, file in imported(folder).items():
        key = OF_TESTS.get(module) or ORIGINS.get(module, Origin(module, None)).rosdep
        assert key is None or key in known or module in OPTIONAL, f'{module} in {file}'


def test_every_dependency_is_one_of_the_code():
    """An unused dependency makes a robot install a superfluous package, or comes from a misspelt key."""
    of_libraries = {origin.rosdep for origin in ORIGINS.values()}
    assert keys('exec_depend') - of_libraries - set(INSTALLED) <= NOT_MODULES
    assert keys('depend') - OF_INTERFACES <= set(INSTALLED)
    assert requirements() <= {origin.pip for origin in ORIGINS.values()}


def test_a_released_package_depends_on_no_pip_key():
    """rosdistro refuses a release that depends on a pip key.

    bloom uses each dependency without a condition and each dependency whose condition holds.
    """
    package = pytest.importorskip('catkin_pkg.package').parse_package(str(ROOT / 'package.xml'))
    for distro in ('jazzy', 'kilted', 'lyrical'):
        package.evaluate_conditions({'ROS_VERSION': '2', 'ROS_DISTRO': distro, 'ROS_PYTHON_VERSION': '3'})
        released = {depend.name for depend in package.exec_depends if depend.evaluated_condition}
        assert not released & PIP_KEYS and not any(name.endswith('-pip') for name in released)
        assert {'python3-numpy', 'python3-can', 'rclpy'} <= released
