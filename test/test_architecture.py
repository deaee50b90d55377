"""Tests that the modules follow the import rules of docs/architecture.md."""

import ast
import re
from collections import Counter
from functools import cache
from pathlib import Path

import draw_architecture as picture
import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'tactile_node'
NUMERICAL = {'conditioning', 'contact', 'helmholtz', 'shape', 'pose', 'grasp', 'learning', 'commissioning'}
CAN_SIDE = {'cia301', 'skin', 'assembly', 'logs', 'bus', 'sources'}
#: Maps each subpackage to the other subpackages that it may import. Every subpackage may also import itself and the
#: top-level modules.
ALLOWED = {
    'contact': set(), 'helmholtz': set(), 'conditioning': set(), 'shape': {'contact', 'helmholtz'},
    'pose': {'contact', 'shape'}, 'grasp': {'shape'}, 'learning': {'conditioning', 'contact', 'pose', 'shape'},
    'commissioning': {'grasp'}, 'library': {'contact', 'helmholtz', 'learning', 'pose', 'shape'},
    'cia301': set(), 'skin': {'cia301'}, 'assembly': {'cia301', 'skin'}, 'logs': {'assembly', 'cia301', 'skin'},
    'bus': {'assembly', 'cia301', 'logs', 'skin'}, 'sources': {'assembly', 'bus', 'cia301', 'logs', 'skin'},
    'simulator': {'bus', 'cia301', 'pose', 'shape', 'skin'},
    'viewing': {'assembly', 'bus', 'cia301', 'conditioning', 'contact', 'helmholtz', 'library', 'logs', 'pose', 'shape',
                'skin', 'sources'},
    'ros': {'assembly', 'bus', 'cia301', 'skin', *NUMERICAL},
    'nodes': {'assembly', 'bus', 'logs', 'ros', 'skin', 'sources', 'viewing', *NUMERICAL},
    'gripper': {'commissioning', 'grasp', 'nodes', 'ros'}}
#: Modules of the gripper controller that read topics.
GRIPPER_NODES = {PACKAGE / 'gripper' / name for name in ('gripper_node.py', 'put_down_watch.py', 'ros_gripper.py')}
#: Modules that the rules of the gripper controller may import from this package.
OF_RULES = ('tactile_node.gripper.rules.', 'tactile_node.grasp.', 'tactile_node.errors', 'tactile_node.parameter')
ROS = {'rclpy', 'tactile_skin', 'std_msgs', 'diagnostic_msgs', 'geometry_msgs', 'rcl_interfaces', 'builtin_interfaces',
       'sensor_msgs', 'tf2_msgs', 'lifecycle_msgs', 'rosgraph_msgs', 'visualization_msgs', 'unique_identifier_msgs',
       'launch', 'launch_ros'}
CAN = {'can', 'canopen'}

#: Modules of bench/recognition/ that generate the test data for the reported results. No model is trained on this data.
REPORTED = ('foreign', 'blemish', 'stamp', 'idle', 'mechanics')


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(ast.parse(path.read_text(encoding='utf-8'))))


@cache
def imports(path: Path) -> set[str]:
    found = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(node.module)
    return found


def modules(folder: str) -> list[Path]:
    found = sorted((PACKAGE / folder).rglob('*.py'))
    assert found, f'no module in {folder}'
    return found


@pytest.mark.parametrize('folder', ALLOWED)
def test_a_stage_imports_only_what_lies_before_it(folder):
    for path in modules(folder):
        ours = {name.split('.')[1] for name in imports(path) if name.startswith('tactile_node.')}
        folders = {name for name in ours if (PACKAGE / name).is_dir()}
        assert folders <= ALLOWED[folder] | {folder}, path


@pytest.mark.parametrize('folder', ['library', 'gripper/rules', *sorted(NUMERICAL)])
def test_the_numerical_core_knows_neither_ros_nor_can(folder):
    for path in modules(folder):
        assert not {name.split('.')[0] for name in imports(path)} & (ROS | CAN), path


@pytest.mark.parametrize('folder', [*sorted(CAN_SIDE), 'simulator', 'viewing'])
def test_the_can_side_knows_no_ros(folder):
    for path in modules(folder):
        assert not {name.split('.')[0] for name in imports(path)} & ROS, path


def test_only_commands_and_the_gripper_controller_import_nodes():
    for path in PACKAGE.rglob('*.py'):
        if path.relative_to(PACKAGE).parts[0] not in ('nodes', 'cli') and path not in GRIPPER_NODES:
            assert not any(name.startswith('tactile_node.nodes') for name in imports(path)), path


COMMISSIONING = [PACKAGE / 'cli/commission.py', PACKAGE / 'cli/skin_measurement.py']


def test_only_the_commissioning_command_imports_the_gripper_controller():
    for path in PACKAGE.rglob('*.py'):
        if path.relative_to(PACKAGE).parts[0] != 'gripper' and path not in COMMISSIONING:
            assert not any(name.startswith('tactile_node.gripper') for name in imports(path)), path


def test_the_rules_of_the_gripper_controller_import_no_other_part_of_it():
    for path in modules('gripper/rules'):
        ours = [name for name in imports(path) if name.startswith('tactile_node.')]
        assert all(name.startswith(OF_RULES) for name in ours), path


def test_each_class_name_is_unique():
    names = Counter(node.name for path in PACKAGE.rglob('*.py') for node in nodes(path)
                    if isinstance(node, ast.ClassDef))
    assert not [name for name, count in names.items() if count > 1]


def test_every_thread_reports_the_exception_that_ends_it():
    starts = re.compile(r'\b(?:threading\.Thread[()]|Thread\(|_thread\.start_new_thread)')
    found = [path.name for path in PACKAGE.rglob('*.py') if starts.search(path.read_text(encoding='utf-8'))]
    assert found == ['threads.py']  # This file defines the project's thread class.


def test_training_knows_nothing_of_the_report():
    found = sorted((ROOT / 'training').glob('*.py'))
    assert found
    for path in found:
        assert not any(name.split('.')[0] == 'bench' for name in imports(path)), path


@pytest.mark.parametrize('module', REPORTED)
def test_reported_figures_are_drawn_without_training_code(module):
    seen, waiting = set(), [f'bench.recognition.{module}']
    while waiting:  # The search also follows indirect imports.
        name = waiting.pop()
        if name in seen or not name.startswith(('bench.', 'training.')):
            continue
        seen.add(name)
        waiting += imports(ROOT / f'{name.replace(".", "/")}.py')
    of_training = {name for name in seen if name.startswith('training.')}
    assert all(name.startswith('training.ground_truth.') for name in of_training), of_training


@pytest.mark.slow
def test_the_picture_shows_the_imports_of_today():
    imports = picture.edges()
    assert (ROOT / 'docs/architecture.txt').read_text(encoding='utf-8') == picture.text(imports), \
        'run `make architecture` and commit docs/architecture.png and .txt'
    assert set(picture.PLACES) == set(picture.rooms())
    for room, found in imports.items():
        assert all(picture.PLACES[below][1] < picture.PLACES[room][1] for below in found), room


def test_every_station_of_a_can_frame_exists():
    page = (ROOT / 'docs/architecture.md').read_text(encoding='utf-8')
    stations = re.findall(r'^\| \d+ \| `([\w/.]+)` `(\w+)\.(\w+)` ', page, re.MULTILINE)
    assert len(stations) == 13
    for path, kind, method in stations:
        source = (PACKAGE / path).read_text(encoding='utf-8')
        assert f'class {kind}' in source and f'def {method}(' in source, (path, kind, method)


def test_each_counter_of_a_lost_frame_exists():
    page = (ROOT / 'docs/architecture.md').read_text(encoding='utf-8')
    losses = page.partition('can be lost at these stations:')[2].partition('An adapter or a device')[0]
    counters = [name for row in losses.splitlines()[4:] if row for name in re.findall(r'`(\w+)`', row.split('|')[3])]
    assert len(counters) > 10
    sources = (PACKAGE / name for name in ('assembly/facts.py', 'ros/message_health.py', 'skin/taxel_array.py'))
    known = ''.join(path.read_text(encoding='utf-8').lower() for path in (*sources, *(ROOT / 'msg').iterdir()))
    assert not [name for name in counters if name.removeprefix('dropped_') not in known]


@pytest.mark.parametrize(('end', 'least'), [('The fields of `FoundContact`', 20), ('Each other module', 8)])
def test_each_file_to_read_comes_after_the_files_that_it_uses(end, least):
    page = (ROOT / 'docs/architecture.md').read_text(encoding='utf-8')
    table = page.partition('## Files to read')[2].partition(end)[0].rpartition('| --- |')[2]
    rows = re.findall(r'^\|[^|]*\| `([\w/]+)\.py`[^|]*\| ([^|]*) \|$', table, re.MULTILINE)
    assert len(rows) > least
    modules_in_order = ['tactile_node.' + path.replace('/', '.') for path, _ in rows]
    for number, (path, read) in enumerate(rows):
        assert not imports(PACKAGE / f'{path}.py') & set(modules_in_order[number + 1:]), path
        source = (PACKAGE / f'{path}.py').read_text(encoding='utf-8')
        assert all(re.search(rf'(def|class) {name}\W', source) for name in re.findall(r'`(\w+)`', read)), path


def test_each_file_to_read_defines_its_classes():
    page = (ROOT / 'docs/architecture.md').read_text(encoding='utf-8')
    listed = re.findall(r'`([\w/]+\.py)`(?: \(([^)]*)\))?', page.partition('## Files to read')[2])
    assert len(listed) > 30
    for path, names in listed:
        source = (PACKAGE / path).read_text(encoding='utf-8')
        assert all(f'class {name}' in source for name in re.findall(r'`(\w+)`', names)), (path, names)
