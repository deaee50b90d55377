"""A driver replays a log, and can provide the ROS time. The topic /clock follows the log, for use_sim_time."""

import pytest
import rclpy
from candump import DATA, read_candump
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from ros_bench import TIMEOUT, RosBench
from rosgraph_msgs.msg import Clock

from tactile_node.nodes.driver_node import DriverNode
from tactile_node.nodes.pad_output import PadOutput
from tactile_node.nodes.replay import CLOCK_STEP
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.time_messages import seconds
from tactile_skin.msg import TaxelArray

pytestmark = [pytest.mark.ros, pytest.mark.bus]

LOG = 'sim16x16_two_pads.log.gz'


class Replay(RosBench):
    """A driver that plays LOG, and a subscriber with use_sim_time."""

    def __init__(self, stack, **given):
        super().__init__(stack)
        given = {'replay': str(DATA / LOG), 'pads': ['left', 'right'], 'node_ids': [32, 64],
                 'publish_clock': True} | given
        self.driver = self.add(DriverNode(
            parameter_overrides=[Parameter(name, value=value) for name, value in given.items()]))
        self.consumer = self.add(rclpy.create_node('consumer',
                                                   parameter_overrides=[Parameter('use_sim_time', value=True)]))


def test_a_consumer_with_simulated_time_sees_the_time_of_the_log(ros):
    """Without /clock, the subscriber's clock reads 0, and each frame seems to lie in the future."""
    replay = Replay(ros)
    seen, clocks = [], []
    replay.consumer.create_subscription(Clock, '/clock', lambda message: clocks.append(seconds(message.clock)), 100)
    replay.consumer.create_subscription(
        TaxelArray, '/left/taxels', lambda frame: seen.append(
            (replay.consumer.get_clock().now().nanoseconds * 1e-9 - seconds(frame.header.stamp), seconds(frame.age))),
        frames_qos(50))
    replay.driver.autostart()
    replay.until(lambda: replay.driver.source.finished.is_set() and len(seen) > 20)
    stamps = [line.stamp for line in read_candump(LOG)]
    late = [passed for passed, _ in seen[5:]]  # After five frames, the subscriber has discovered /clock.
    length = stamps[-1] - stamps[0]
    # ROS does not define the order of messages on two topics.
    assert all(-length < passed < length for passed in late), late
    assert min(abs(passed) for passed in late) < 2 * CLOCK_STEP
    assert clocks == sorted(clocks) and stamps[0] <= clocks[0] and clocks[-1] <= stamps[-1]
    assert len(clocks) <= length / CLOCK_STEP + 1
    assert all(0 < age < TIMEOUT for _, age in seen)  # The age counts from the playback, not from the recording.


def test_a_live_bus_does_not_publish_the_time(ros):
    replay = Replay(ros, replay='', interface='virtual', channel='clock')
    assert replay.driver.trigger_configure() == TransitionCallbackReturn.FAILURE
    assert 'publish_clock' in str(replay.driver._steps.error)


def test_without_the_parameter_there_is_no_clock(ros):
    replay = Replay(ros, publish_clock=False)
    replay.driver.autostart()
    replay.until(lambda: replay.driver.source.facts().pad('left').frames_complete > 3)
    assert replay.consumer.count_publishers('/clock') == 0


def test_a_frame_that_cannot_be_published_is_counted(ros, monkeypatch):
    """A consumer of the facts must see that a replay is not whole."""
    replay = Replay(ros, publish_clock=False, replay_pace=0.0)
    send = PadOutput.send_frame
    with monkeypatch.context() as patch:
        patch.setattr(PadOutput, 'send_frame',
                      lambda output, frame: 1 / 0 if frame.sequence == 3 else send(output, frame))
        replay.driver.autostart()
        replay.until(lambda: replay.driver.source.finished.is_set())
        assert replay.driver.source.facts().consumer_errors == 2  # one for each pad
