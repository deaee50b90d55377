"""A node that receives stamps from another clock reports their offset from the clock of its own host."""

import math
import time
from threading import Event, Thread

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.parameter import Parameter
from ros_bench import RosBench

from tactile_node.nodes.processor_node import ProcessorNode
from tactile_node.pose.pipeline import Taxels
from tactile_node.ros.contact_messages import PadFrame, taxel_array_message
from tactile_node.ros.message_health import MessageCounts, StreamHealth, health_status
from tactile_node.ros.time_messages import duration_message
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus
from tactile_skin.msg import TaxelArray

pytestmark = pytest.mark.ros

FRAME_PERIOD = 0.05  # Time between two frames [s].
AGE = 1.5  # Age of each frame when it is sent [s], which must not count as an offset of the clocks.
LIMIT = 0.05  # Default value of the parameter max_clock_offset [s].
WARN, STALE, OK = DiagnosticStatus.WARN, DiagnosticStatus.STALE, DiagnosticStatus.OK


def values_of(status):
    return {pair.key: pair.value for pair in status.values}


def send(publisher, lead, stop):
    """Publish frames of a driver whose clock is ``lead`` [s] ahead until ``stop`` is set."""
    for sequence in range(10**6):
        values = np.zeros((4, 4), np.float32)
        frame = TaxelFrame(time.time() + lead - AGE, sequence, values, np.full((4, 4), TaxelStatus.VALID, np.uint8), 0)
        message = taxel_array_message(PadFrame.of(frame, Taxels(0.002, 'Pa'), 'left_pad'))
        message.age = duration_message(AGE)
        publisher.publish(message)
        if stop.wait(FRAME_PERIOD):
            return


@pytest.fixture
def reported(ros):
    """Return a function that returns the first processor status with a known age.

    The processor receives frames of a driver whose clock is ``lead`` [s] ahead.
    """
    def report(lead, **parameters):
        bench, found, stop = RosBench(ros), [], Event()
        bench.add(ProcessorNode(namespace='/left', parameter_overrides=[
            Parameter(name, value=value) for name, value in parameters.items()]))
        driver = bench.add('driver')
        driver.create_subscription(DiagnosticArray, '/diagnostics', lambda message: found.extend(
            status for status in message.status if values_of(status)['age_s'] != 'not known'), 10)
        sender = Thread(target=send, args=(driver.create_publisher(TaxelArray, '/left/taxels', 10), lead, stop))
        sender.start()
        ros.callback(sender.join)
        ros.callback(stop.set)
        bench.until(lambda: found, 'age not known')
        return found[0]
    return report


# A slow link could also cause an offset of -0.3 s.
@pytest.mark.parametrize(('lead', 'is_apart'), [(3600.0, True), (-0.3, False)])
def test_stamps_of_another_clock_are_reported(reported, lead, is_apart):
    status = reported(lead)
    values = values_of(status)
    assert ('CLOCKS_APART' in values['faults']) is is_apart, status
    assert lead - 0.3 < float(values['stamps_offset_s']) < lead + 0.01  # A busy machine delays the messages in transit.


def test_simulated_time_is_compared_with_no_clock(reported):
    values = values_of(reported(3600.0, use_sim_time=True))
    assert (values['stamps_offset_s'], 'CLOCKS_APART' in values['faults']) == ('not known', False)


def test_a_limit_of_the_user_silences_the_warning(reported):
    values = values_of(reported(-3600.0, max_clock_offset=1e9))
    assert 'CLOCKS_APART' not in values['faults'] and float(values['stamps_offset_s']) < -3599


def status_of(left, right=0.0, received=54):
    """Return the status of a grasp node one second after it received 4 messages on each topic.

    ``left`` and ``right`` are the times by which the stamps are ahead of the node's clock [s].
    """
    before = {f'/{pad}/shape': MessageCounts(4, 4, {}) for pad in ('left', 'right')}
    now = {topic: StreamHealth(MessageCounts(received, received, {}), 0.02, ('/driver',), stamps_offset=offset)
           for topic, offset in zip(before, (left, right))}
    return health_status('/grasp', now, before, 1.0, LIMIT)


@pytest.mark.parametrize(('offset', 'level'), [
    (0.049, OK), (0.051, WARN), (-0.051, OK), (-0.499, OK), (-0.501, WARN), (math.nan, OK)])
def test_the_way_may_take_time_but_none_below_zero(offset, level):
    status = status_of(offset)
    assert (status.level, values_of(status)['faults']) == (level, 'CLOCKS_APART' if level == WARN else 'NONE')


def test_the_topic_whose_stamps_are_farthest_is_shown():
    status = status_of(0.2, -1.2345)
    assert values_of(status)['stamps_offset_s'] in ('-1.234', '-1.235')
    assert '/left/shape' in status.message and '/right/shape' in status.message


def test_a_stopped_publisher_is_reported_only_as_silent():
    status = status_of(7.0, received=4)
    assert (status.level, values_of(status)['faults']) == (STALE, 'SILENT')
