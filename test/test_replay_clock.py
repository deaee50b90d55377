"""A replay can give the time: /clock follows the log, for consumers with use_sim_time."""

import time
from contextlib import ExitStack

import pytest
from candump import DATA, read_candump

rclpy = pytest.importorskip('rclpy')
pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.lifecycle import TransitionCallbackReturn  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402

from tactile_node.nodes.driver_node import DriverNode  # noqa: E402
from tactile_node.nodes.replay import CLOCK_STEP  # noqa: E402
from tactile_node.ros.qos import frames_qos  # noqa: E402
from tactile_node.ros.time_messages import seconds  # noqa: E402
from tactile_skin.msg import TaxelArray  # noqa: E402

pytestmark = [pytest.mark.ros, pytest.mark.bus]

LOG = 'sim16x16_two_pads.log.gz'
TIMEOUT = 60.0  # s, for a busy machine


class Replay:
    """A driver that plays LOG, and a consumer with use_sim_time."""

    def __init__(self, stack: ExitStack, **given):
        given = {'replay': str(DATA / LOG), 'pads': ['left', 'right'], 'node_ids': [32, 64],
                 'publish_clock': True} | given
        self.driver = DriverNode(parameter_overrides=[Parameter(name, value=value) for name, value in given.items()])
        self.consumer = rclpy.create_node('consumer',
                                          parameter_overrides=[Parameter('use_sim_time', value=True)])
        self.executor = SingleThreadedExecutor()
        for node in (self.driver, self.consumer):
            self.executor.add_node(node)
            stack.callback(node.destroy_node)
        stack.callback(self.executor.shutdown)

    def wait(self, condition) -> None:
        deadline = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < deadline, 'timeout'
            self.executor.spin_once(timeout_sec=0.1)


@pytest.fixture
def stack():
    rclpy.init()
    with ExitStack() as stack:
        stack.callback(rclpy.shutdown)
        yield stack


def test_a_consumer_with_simulated_time_sees_the_time_of_the_log(stack):
    """Without it, its clock reads 0 and each frame comes from the future."""
    replay = Replay(stack)
    seen, clocks = [], []
    replay.consumer.create_subscription(Clock, '/clock', lambda message: clocks.append(seconds(message.clock)), 100)
    replay.consumer.create_subscription(
        TaxelArray, '/left/taxels', lambda frame: seen.append(
            (replay.consumer.get_clock().now().nanoseconds * 1e-9 - seconds(frame.header.stamp), seconds(frame.age))),
        frames_qos(50))
    replay.driver.autostart()
    replay.wait(lambda: replay.driver.source.finished.is_set() and len(seen) > 20)
    stamps = [line.stamp for line in read_candump(LOG)]
    late = [passed for passed, _ in seen[5:]]  # once /clock is discovered
    length = stamps[-1] - stamps[0]
    assert all(-length < passed < length for passed in late), late  # the order of two topics is open
    assert min(abs(passed) for passed in late) < 2 * CLOCK_STEP
    assert clocks == sorted(clocks) and stamps[0] <= clocks[0] and clocks[-1] <= stamps[-1]
    assert len(clocks) <= length / CLOCK_STEP + 1
    assert all(0 < age < TIMEOUT for _, age in seen)  # since it was played, not since it was recorded


def test_clocks_of_a_looped_log_do_not_go_back(stack):
    replay = Replay(stack, replay_pace=0.0, replay_loop=True)
    clocks = []
    replay.consumer.create_subscription(Clock, '/clock', lambda message: clocks.append(seconds(message.clock)), 1000)
    replay.driver.autostart()
    length = read_candump(LOG)[-1].stamp - read_candump(LOG)[0].stamp
    replay.wait(lambda: clocks and clocks[-1] - clocks[0] > 2 * length)
    assert clocks == sorted(clocks)


def test_a_live_bus_does_not_publish_the_time(stack):
    replay = Replay(stack, replay='', interface='virtual', channel='clock')
    assert replay.driver.trigger_configure() == TransitionCallbackReturn.FAILURE
    assert 'publish_clock' in str(replay.driver._steps.error)


def test_without_the_parameter_there_is_no_clock(stack):
    replay = Replay(stack, publish_clock=False)
    replay.driver.autostart()
    replay.wait(lambda: replay.driver.source.statistics().pads['left'].complete > 3)
    assert replay.consumer.count_publishers('/clock') == 0
