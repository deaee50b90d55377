"""Setup of all tests: ROS traffic stays on this machine, and each run of pytest uses its own ROS domain."""

import fcntl
import gc
import itertools
import os
import re
import tempfile
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

import pytest

#: Linux never assigns the ports of the domains up to 101 to other programs. test_tutorial.py uses domain 101.
DOMAINS = range(1, 101)


def lock_domain() -> tuple[int, TextIO]:
    """Return a ROS domain that no other run of these tests uses, and the open file whose lock reserves the domain."""
    for domain in DOMAINS:
        lock = Path(tempfile.gettempdir(), f'tactile_skin_ros_domain_{domain}').open('w')
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return domain, lock
        except BlockingIOError:
            lock.close()
    raise RuntimeError(f'all ROS domains of {DOMAINS} are in use')


os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
DOMAIN, DOMAIN_LOCK = lock_domain()
os.environ['ROS_DOMAIN_ID'] = str(DOMAIN)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_call(item):
    """Skip a real-time test if it raises TooSlowError (see can_bench.py)."""
    outcome = yield
    error = outcome.excinfo[1] if outcome.excinfo else None
    if type(error).__name__ == 'TooSlowError':
        outcome.force_exception(pytest.skip.Exception(f'the machine does not keep up: {error}'))


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_teardown(item):
    """Destroy the ROS nodes that a test leaves in reference cycles.

    The garbage collector would otherwise destroy several nodes at once during another test. In one run, Fast DDS then
    hung for ever in `DomainParticipant::set_listener`. Before that hang, test_one_process.py had left four participants
    behind.
    """
    yield
    if item.get_closest_marker('ros'):
        gc.collect()


def processor_time() -> float:
    """Return the processor time of this process and of its finished children [s]."""
    return sum(os.times()[:4])


#: MARK finds a mark in the text of a module. MODULE_MARKS finds the statement that marks all tests of a module.
MARK = re.compile(r'pytest\.mark\.(ros|bus|slow)')
MODULE_MARKS = re.compile(r'^pytestmark = (\[.*?\]|.*?)$', re.MULTILINE | re.DOTALL)


#: Estimated wall time of the slowest test files in `make test` [s]. Every other file counts as OTHER_WALL_TIME.
WALL_TIME = {
    'test_assess.py': 20, 'test_can_commands.py': 25, 'test_commissioning.py': 30,
    'test_contact_moments.py': 15, 'test_demo.py': 20, 'test_documented_commands.py': 35,
    'test_driver_conditioning.py': 20, 'test_driver_recovery.py': 50, 'test_event_skins.py': 15, 'test_faults.py': 60,
    'test_finalized.py': 20, 'test_full_bus.py': 10, 'test_grasp_node.py': 25, 'test_grasp_requests.py': 15,
    'test_gripper_crash.py': 50, 'test_gripper_duplicates.py': 30, 'test_gripper_faults.py': 10,
    'test_gripper_node.py': 25, 'test_link.py': 40, 'test_malformed_messages.py': 10, 'test_misled.py': 15,
    'test_motion.py': 40, 'test_one_process.py': 10, 'test_other_skin.py': 15, 'test_planner_client.py': 15,
    'test_planner_loop.py': 20, 'test_put_down.py': 20, 'test_reproduction.py': 15, 'test_skin_bus.py': 15,
    'test_slow_device.py': 15, 'test_teach.py': 15, 'test_touch_client.py': 15, 'test_tutorial.py': 50}
OTHER_WALL_TIME = 3


def pytest_addoption(parser):
    parser.addoption('--part', default='1/1', metavar='K/N', help='run only the Kth of N parts of the test files, '
                     'so that N parallel runs share the tests')


def part_of(names, part, parts):
    """Return the files in one of ``parts`` parts that take about the same time."""
    shares = [[] for _ in range(parts)]
    for name in sorted(names, key=lambda name: (-WALL_TIME.get(name, OTHER_WALL_TIME), name)):
        min(shares, key=lambda share: sum(WALL_TIME.get(each, OTHER_WALL_TIME) for each in share)).append(name)
    return shares[part - 1]


def pytest_ignore_collect(collection_path, config):
    """Ignore the files of other parts of the test suite, and files without a test for this run.

    Importing all files would take 15 s in each part of the test suite.
    """
    if collection_path.suffix != '.py' or collection_path.parent != Path(__file__).parent:
        return None
    files = config.stash.get(FILES, None)
    if files is None:
        part, parts = map(int, config.getoption('part').split('/'))
        files = config.stash[FILES] = part_of([path.name for path in collection_path.parent.glob('test_*.py')
                                               if may_have_tests(path, config.option.markexpr)], part, parts)
    return None if collection_path.name in files else True


def may_have_tests(path, markexpr):
    """Return True if the file may contain tests with the marks in ``markexpr``, judging by its text."""
    if not markexpr:
        return True
    text = path.read_text()
    module_marks = MODULE_MARKS.search(text)
    certain = set(MARK.findall(module_marks[0])) if module_marks else set()
    choices = [(True,) if mark in certain else (True, False) if f'mark.{mark}' in text else (False,)
               for mark in ('ros', 'bus', 'slow')]
    return any(eval(markexpr, {'ros': ros, 'bus': bus, 'slow': slow})
               for ros, bus, slow in itertools.product(*choices))


#: Names of the files in this part that may contain a test with the marks of this run.
FILES = pytest.StashKey[list]()
#: Processor time per test file, for collecting the file and running its tests [s].
PROCESSOR_TIME = pytest.StashKey[Counter]()


def pytest_configure(config):
    config.stash[PROCESSOR_TIME] = Counter()


def pytest_collection_modifyitems(config, items):
    """Leave out the cases with the mark ``long``, unless TACTILE_LONG is set."""
    if os.environ.get('TACTILE_LONG'):
        return
    config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker('long')])
    items[:] = [item for item in items if not item.get_closest_marker('long')]


def pytest_collection_finish():
    """Exclude all imported objects from later garbage collections, which would otherwise take 0.15 s each."""
    gc.freeze()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item):
    began = processor_time()
    yield
    item.config.stash[PROCESSOR_TIME][item.path.name] += processor_time() - began


def pytest_terminal_summary(terminalreporter, config):
    """Print the processor time of the run.

    With ``-v``, also print the processor time of each file, the largest first.
    """
    used = config.stash[PROCESSOR_TIME]
    total = processor_time()
    terminalreporter.write_line(f'processor time {total:.0f} s, of which {total - used.total():.0f} s outside tests')
    if config.option.verbose > 0:
        for name, seconds in used.most_common():
            terminalreporter.write_line(f'{seconds:8.1f} s  {name}')


#: Modules that may be missing when a test file imports them, each with the reason.
OF_ROS = {'rclpy': 'ROS 2 is not installed', 'tactile_skin': 'the messages are not built: run `make setup`',
          **{name: f'{name} is not installed' for name in ('py_trees', 'rosidl_adapter', 'xacro')}}


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector):
    """Skip the test files of ROS nodes if ROS 2 or our messages are missing, and state the reason."""
    outcome = yield
    report = outcome.get_result()
    missing = getattr(report.call.excinfo and report.call.excinfo.value.__cause__, 'name', None) or ''
    reason = OF_ROS.get(missing.partition('.')[0])
    if report.failed and reason:
        report.outcome, report.longrepr = 'skipped', (str(collector.path), 0, f'Skipped: {reason}')



@pytest.fixture
def ros():
    """Run ROS. Objects on the stack are closed before ROS is shut down."""
    import rclpy
    rclpy.init()
    with ExitStack() as stack:
        stack.callback(rclpy.shutdown)
        yield stack


@pytest.fixture(scope='session')
def tf_message():
    """The message type of the topic /tf."""
    from built_messages import BUILT, built_messages
    with built_messages('tf2_msgs', BUILT):
        from tf2_msgs.msg import TFMessage
        yield TFMessage


@pytest.fixture(scope='session')
def control_msgs():
    """The action types of grippers."""
    from built_messages import BUILT, built_messages
    with built_messages('control_msgs', BUILT):
        yield


@pytest.fixture(scope='session')
def collision_object_message():
    """The message type that MoveIt's planning scene accepts."""
    from built_messages import generated_messages
    with generated_messages('moveit_msgs'):
        from moveit_msgs.msg import CollisionObject
        yield CollisionObject
