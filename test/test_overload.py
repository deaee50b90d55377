"""A stage that is too slow processes the newest frame and counts the frames that it missed.

In a lossless replay, a slow stage loses no frame.
"""

import threading
import time

import numpy as np
import pytest
import rclpy
from ros_bench import RosBench

from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.pose.pipeline import Taxels
from tactile_node.ros.contact_messages import PadFrame, taxel_array_message
from tactile_node.ros.message_checks import check_taxel_array
from tactile_node.ros.qos import frames_qos
from tactile_node.taxel_frame import TaxelFrame
from tactile_skin.msg import Contact, TaxelArray

pytestmark = [pytest.mark.ros, pytest.mark.bus]

SIDE, PERIOD, SENT, TIMEOUT = 8, 0.01, 40, 60.0


def taxels(sequence):
    values, status = np.zeros((SIDE, SIDE), np.float32), np.ones((SIDE, SIDE), np.uint8)
    frame = TaxelFrame(time.time(), sequence, values, status, 0)
    return taxel_array_message(PadFrame.of(frame, Taxels(0.002, 'Pa'), 'pad'))


def followed_at_half_speed(ros, lossless):
    """Send SENT messages to a stage that needs two periods for each message.

    Return the subscription of the stage and the processed messages.
    """
    bench = RosBench(ros)
    sender, receiver = rclpy.create_node('sender'), bench.add('receiver')
    ros.callback(sender.destroy_node)
    worked_on, sent = [], {}

    def work(message):
        time.sleep(2 * PERIOD)
        worked_on.append((message.sequence, time.time()))
    qos = frames_qos(SENT, lossless)
    subscription = GuardedSubscription(receiver, TaxelArray, 'taxels', work, qos, check=check_taxel_array,
                                       newest_only=True, lossless=lossless)
    publisher = sender.create_publisher(TaxelArray, 'taxels', qos)
    bench.until(publisher.get_subscription_count)

    def send():
        for sequence in range(SENT):
            sent[sequence] = time.time()
            publisher.publish(taxels(sequence))
            time.sleep(PERIOD)
    thread = threading.Thread(target=send)
    thread.start()
    bench.until(lambda: worked_on and worked_on[-1][0] == SENT - 1)
    thread.join()
    return subscription.counts, [number for number, _ in worked_on], [end - sent[number] for number, end in worked_on]


def test_a_stage_at_half_speed_processes_the_newest_frame_and_counts_the_others(ros):
    counts, numbers, ages = followed_at_half_speed(ros, lossless=False)
    assert counts.received == SENT and counts.processed == len(numbers) < SENT
    assert counts.overtaken == SENT - len(numbers) and not counts.dropped and not counts.skipped
    assert numbers == sorted(numbers)
    # If the stage processed every message in order, the last message would be SENT periods old.
    assert np.median(ages) < SENT * PERIOD / 4


def test_frames_that_an_earlier_stage_left_out_do_not_count_as_lost(ros):
    """In an earlier version, the processor left out frames within its allowance of 5 %.

    The classifier then reported the omitted frames as lost.
    """
    bench = RosBench(ros)
    receiver, qos = bench.add('receiver'), frames_qos(SENT)
    subscription = GuardedSubscription(receiver, Contact, 'contact', lambda message: None, qos,
                                       check=lambda message: None)
    publisher = bench.add('sender').create_publisher(Contact, 'contact', qos)
    bench.until(publisher.get_subscription_count)
    # One message is lost between the last two messages.
    for received, (sequence, before) in enumerate(((1, 0), (2, 0), (5, 2), (9, 2)), 1):
        message = Contact(sequence=sequence, left_out=before)
        message.header.stamp = receiver.get_clock().now().to_msg()
        publisher.publish(message)
        bench.until(lambda received=received: subscription.counts.received == received)
    assert subscription.counts.skipped == 1


def test_a_lossless_stage_at_half_speed_processes_all_frames(ros):
    counts, numbers, _ = followed_at_half_speed(ros, lossless=True)
    assert numbers == list(range(SENT)) and counts.overtaken == 0
