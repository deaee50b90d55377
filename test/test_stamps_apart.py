"""A node that receives stamps of another clock reports how far they are from the clock of its host."""

import math
import time
from contextlib import ExitStack
from threading import Event, Thread

import numpy as np
import pytest

rclpy = pytest.importorskip('rclpy')
pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402

from tactile_node.nodes.processor_node import ProcessorNode  # noqa: E402
from tactile_node.nodes.spinning import spinning  # noqa: E402
from tactile_node.pose.pipeline import Taxels  # noqa: E402
from tactile_node.ros.contact_messages import PadFrame, taxel_array_message  # noqa: E402
from tactile_node.ros.message_health import MessageCounts, StreamHealth, health_status  # noqa: E402
from tactile_node.ros.qos import frames_qos  # noqa: E402
from tactile_node.ros.time_messages import duration_message  # noqa: E402
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus  # noqa: E402
from tactile_skin.msg import TaxelArray  # noqa: E402

pytestmark = pytest.mark.ros

TIMEOUT = 60.0  # s, for a busy machine
FRAME_PERIOD = 0.05  # s
AGE = 1.5  # s that each frame is old when it is sent: no part of what the clocks are apart
LIMIT = 0.05  # s, of max_clock_offset by default
WARN, STALE, OK = DiagnosticStatus.WARN, DiagnosticStatus.STALE, DiagnosticStatus.OK


def values_of(status):
    return {pair.key: pair.value for pair in status.values}


def send(publisher, lead, stop):
    """Publish frames of a driver whose clock is ``lead`` [s] ahead."""
    for sequence in range(10**6):
        values = np.zeros((4, 4), np.float32)
        frame = TaxelFrame(time.time() + lead - AGE, sequence, values, np.full((4, 4), TaxelStatus.VALID, np.uint8), 0)
        message = taxel_array_message(PadFrame.of(frame, Taxels(0.002, 'Pa'), 'left_pad'))
        message.age = duration_message(AGE)
        publisher.publish(message)
        if stop.wait(FRAME_PERIOD):
            return


def reported(lead, **parameters):
    """The first status of a processor that knows the age of what a driver sends whose clock is ``lead`` [s] ahead."""
    with ExitStack() as stack:
        rclpy.init()
        stack.callback(rclpy.shutdown)
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        processor = ProcessorNode(namespace='/left', parameter_overrides=overrides)
        driver = rclpy.create_node('driver')
        found, known = [], Event()

        def note(message):
            for status in message.status:
                if values_of(status)['age_s'] != 'not known':
                    found.append(status)
                    known.set()
        driver.create_subscription(DiagnosticArray, '/diagnostics', note, 10)
        publisher = driver.create_publisher(TaxelArray, '/left/taxels', frames_qos(10))
        for node in (processor, driver):
            stack.callback(node.destroy_node)
        stack.enter_context(spinning([processor, driver]))
        stop = Event()
        sender = Thread(target=send, args=(publisher, lead, stop))
        sender.start()
        stack.callback(sender.join)
        stack.callback(stop.set)
        assert known.wait(TIMEOUT)
        return found[0]


@pytest.mark.parametrize(('lead', 'is_apart'), [
    (3600.0, True), (0.3, True), (0.0, False), (-0.3, False), (-3600.0, True)])  # 0.3 s may be a slow link
def test_stamps_of_another_clock_are_reported(lead, is_apart):
    status = reported(lead)
    values = values_of(status)
    assert ('CLOCKS_APART' in values['faults']) is is_apart, status
    assert lead - 0.3 < float(values['stamps_offset_s']) < lead + 0.01  # a busy machine takes its time on the way


def test_simulated_time_is_compared_with_no_clock():
    values = values_of(reported(3600.0, use_sim_time=True))
    assert (values['stamps_offset_s'], 'CLOCKS_APART' in values['faults']) == ('not known', False)


def test_a_limit_of_the_user_silences_the_warning():
    values = values_of(reported(-3600.0, max_clock_offset=1e9))
    assert 'CLOCKS_APART' not in values['faults'] and float(values['stamps_offset_s']) < -3599


def status_of(left, right=0.0, received=54):
    """The status of a grasp node whose stamps are ahead of its clock by so much [s], a second after 4 messages."""
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


def test_what_has_stopped_is_silent_and_no_more():
    status = status_of(7.0, received=4)
    assert (status.level, values_of(status)['faults']) == (STALE, 'SILENT')
