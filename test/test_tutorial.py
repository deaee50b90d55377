"""The first pages of the documentation lead a newcomer to a shape and to a grasp.

The test runs the commands of these pages exactly as printed.
"""

import os
import shlex
import subprocess
import sys
import time
from collections import Counter
from contextlib import ExitStack
from math import sqrt
from pathlib import Path

import documented_commands as documented
import pytest
from ros_bench import RosBench
from shape_listener import text_of
from waiting import until

from tactile_node.node_graph import NODE_NAMES, Role
from tactile_skin.msg import ContactShape

ROOT = Path(__file__).resolve().parents[1]
pytestmark = [pytest.mark.ros, pytest.mark.bus]
# A busy machine loses CAN frames at the SYNC period of the pages.
SLOWLY = '--ros-args', '-p', f'{NODE_NAMES[Role.DRIVER]}:sync_period:=0.1'
TUTORIAL, PLANNER = 'docs/tutorial.md', 'docs/howto/my_planner.md'
SHAPES = ('circle', 'square', 'rectangle', 'right_triangle', 'isosceles_triangle')
TIMEOUT = 60.0  # Time limit on a busy machine [s].


def started(stack: ExitStack, beginning: str, link: Path, page: str = TUTORIAL, *, more=()) -> subprocess.Popen:
    """Start the page's command that begins with ``beginning``, and put its link in a folder of this test.

    The words in ``more`` follow those of the page. Closing ``stack`` ends the started process.
    """
    text, = (each.text for each in documented.commands_of((ROOT / page).read_text(encoding='utf-8'), page)
             if each.text.startswith(beginning) and not each.in_sentence)
    program, *words = shlex.split(text.replace('/tmp/skin', str(link)))
    module = ['-m', 'tactile_node.cli.main'] if program == 'tactile' else []
    process = subprocess.Popen([sys.executable, *module, *words, *more], cwd=ROOT, text=True, stdout=subprocess.PIPE,
                               stderr=subprocess.DEVNULL)

    def end() -> None:
        process.terminate()
        process.wait(TIMEOUT)
        process.stdout.close()
    stack.callback(end)
    return process


@pytest.fixture(scope='module')
def parent():
    """A process with which the driver and the perception end."""
    process = subprocess.Popen(['sleep', '1000'])
    yield process
    process.kill()
    process.wait()


@pytest.fixture(scope='module')
def bringup(parent, tmp_path_factory):
    """The driver and the perception of a simulated skin, as started in the tutorial."""
    link = tmp_path_factory.mktemp('tutorial') / 'skin'
    with ExitStack() as stack:
        started(stack, 'tactile simulate', link)
        until(link.is_symlink, TIMEOUT)
        yield started(stack, 'tactile bringup', link, more=['--end-with', str(parent.pid), *SLOWLY])


def test_the_listener_prints_the_reason_for_unknown():
    unknown = ContactShape(shape=ContactShape.UNKNOWN, class_name='unknown', confidence=1.0,
                           unknown_reason=ContactShape.CUT_BY_EDGE)
    assert text_of(unknown).split(maxsplit=3) == ['unknown', '100', '%', 'cut by edge']


def test_a_newcomer_gets_a_shape_on_a_topic(bringup, tmp_path):
    with ExitStack() as stack:
        listener = started(stack, 'python examples/shape_listener.py', tmp_path)
        seen = ''
        for line in listener.stdout:
            seen += line
            if 'mm' in line:
                break
    name, confidence, rest = seen.splitlines()[-1].split(maxsplit=2)
    assert name in SHAPES
    assert 50 < int(confidence) <= 100 and rest.startswith('%') and 'mm' in rest


def test_the_force_on_a_simulated_skin_has_a_standard_deviation(bringup, ros):
    """The standard deviation of a taxel is 0.5 % of 100 kPa on 2 mm x 2 mm, and the contacts have 40 to 80 taxels.

    The ring of a contact of 40 taxels has about 30 taxels, so the standard deviation of the force is up to 1.3 times
    that of the contact's taxels. Dead taxels increase it further. The test therefore waits for ten messages with nearly
    the expected standard deviation. It does not ask how long the object is held, because `held`
    begins again whenever a busy machine loses a CAN frame.
    """
    bench, reasons, ratios = RosBench(ros), Counter(), []
    of_taxel = 0.005 * 100e3 * 0.002**2

    def take(shape):
        reasons[shape.class_name, shape.unknown_reason, shape.fit_valid] += 1
        if shape.fit_valid:
            ratios.append(shape.force_sd / (of_taxel * sqrt(shape.taxels)))
    bench.add('reader').create_subscription(ContactShape, '/pad/shape', take, 10)
    try:
        bench.until(lambda: sum(ratio < 1.5 for ratio in ratios) >= 10)
    except AssertionError as error:
        raise AssertionError(f'no ten such messages, but {reasons} and ratios {sorted(ratios)}') from error
    assert min(ratios) > 0.7


def test_the_driver_ends_with_the_process_that_is_named(bringup, parent):
    """This test is the last one that uses the process."""
    assert bringup.poll() is None
    parent.kill()
    parent.wait()
    assert bringup.wait(TIMEOUT) == 0


def test_a_planner_waits_for_a_grasp(tmp_path):
    with ExitStack() as stack:
        started(stack, 'tactile bringup --simulate', tmp_path / 'skin', PLANNER, more=SLOWLY)
        listener = started(stack, 'python examples/grasp_listener.py', tmp_path, PLANNER)
        # On a busy machine, the first grasps may be of an unknown shape.
        assert any('mm' in line and line.split(',')[0] in SHAPES for line in listener.stdout)
        deadline, found = time.monotonic() + TIMEOUT, ''
        # A busy machine may lose the grasp during the request. The planner reports the loss, and the test tries again.
        while not found:
            assert time.monotonic() < deadline
            found = subprocess.run([sys.executable, 'examples/wait_for_grasp.py'], cwd=ROOT, text=True,
                                   timeout=TIMEOUT, stdout=subprocess.PIPE).stdout
    name, *rest = found.split(', ')
    # The page configures no gripper opening, so the width is unknown.
    assert name in SHAPES and rest[-1] == 'width not known\n'


def test_a_planner_without_a_grasp_node_gets_a_remedy():
    at_once = 'import sys; from examples import wait_for_grasp as example; example.LATE = 0.1; sys.exit(example.main())'
    ended = subprocess.run([sys.executable, '-c', at_once], cwd=ROOT, text=True, timeout=TIMEOUT,
                           stderr=subprocess.PIPE, env=os.environ | {'ROS_DOMAIN_ID': '101'})
    assert ended.returncode == 1 and PLANNER in ended.stderr
