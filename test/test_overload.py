"""A stage that cannot keep up works on the newest frame and counts the others; a lossless replay loses nothing."""

import os
import threading
import time

import numpy as np
import pytest
import rclpy
from can_bench import wait_until
from hidden_skin import NODE_ID, write_log
from rclpy.parameter import Parameter
from ros_bench import RosBench

from tactile_node.nodes import replay
from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.driver_node import DriverNode
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.processor_node import ProcessorNode
from tactile_node.nodes.replay import WINDOW, ReplayGate
from tactile_node.ros.contact_messages import taxel_array_message
from tactile_node.ros.message_checks import check_taxel_array
from tactile_node.ros.qos import frames_qos
from tactile_node.taxel_frame import TaxelFrame
from tactile_skin.msg import Contact, ContactShape, Progress, TaxelArray

pytestmark = [pytest.mark.ros, pytest.mark.bus]

SIDE, PERIOD, SENT, TIMEOUT = 8, 0.01, 40, 60.0
REPLAYED = 10_000 if os.environ.get('TACTILE_LONG') else WINDOW + 200


def taxels(sequence):
    values, status = np.zeros((SIDE, SIDE), np.float32), np.ones((SIDE, SIDE), np.uint8)
    return taxel_array_message(TaxelFrame(time.time(), sequence, values, status, 0), 0.002, 'Pa', 'pad')


def followed_at_half_speed(ros, lossless):
    """Send SENT messages to a stage that takes two periods for each; return its subscription and what it worked on."""
    bench = RosBench(ros)
    sender, receiver = rclpy.create_node('sender'), bench.add('receiver')
    ros.callback(sender.destroy_node)
    worked_on, sent = [], {}

    def work(message):
        time.sleep(2 * PERIOD)
        worked_on.append((message.sequence, time.time()))
    qos = frames_qos(SENT, lossless)
    subscription = GuardedSubscription(receiver, TaxelArray, 'taxels', work, qos, check=check_taxel_array,
                                       newest_only=True)
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


def test_a_stage_of_half_the_speed_works_on_the_newest_and_counts_the_others(ros):
    counts, numbers, ages = followed_at_half_speed(ros, lossless=False)
    assert counts.received == SENT and counts.processed == len(numbers) < SENT
    assert counts.overtaken == SENT - len(numbers) and not counts.dropped and not counts.skipped
    assert numbers == sorted(numbers)
    # In order and without a loss the last one would be SENT periods old.
    assert np.median(ages) < SENT * PERIOD / 4


def test_what_a_stage_before_has_left_out_is_no_loss(ros):
    """The processing node was within its 5 %, and the classifier warned of frames that never arrived."""
    bench = RosBench(ros)
    receiver, left_out, qos = bench.add('receiver'), [], frames_qos(SENT)
    subscription = GuardedSubscription(receiver, Contact, 'contact', check=lambda message: None, qos=qos,
                                       callback=lambda message: left_out.append(subscription.left_out))
    publisher = bench.add('sender').create_publisher(Contact, 'contact', qos)
    bench.until(publisher.get_subscription_count)
    for received, (sequence, before) in enumerate(((1, 0), (2, 0), (5, 2), (9, 2)), 1):  # of the last gap, one is lost
        message = Contact(sequence=sequence, left_out=before)
        message.header.stamp = receiver.get_clock().now().to_msg()
        publisher.publish(message)
        bench.until(lambda received=received: subscription.counts.received == received)
    assert subscription.counts.skipped == 1 and left_out == [0, 0, 2, 2]


def test_a_lossless_stage_of_half_the_speed_works_on_all(ros):
    counts, numbers, _ = followed_at_half_speed(ros, lossless=True)
    assert numbers == list(range(SENT)) and counts.overtaken == 0


@pytest.fixture
def gate(ros, monkeypatch):
    """A gate of two pads that gives up at once, and what a classifier reports to it."""
    monkeypatch.setattr(replay, 'TIMEOUT', 0.2)
    found = ReplayGate(RosBench(ros).add('driver'), ['left', 'right'], frames_qos(10, lossless=True))
    ros.callback(found.destroy)
    return found


def waits(gate, pad, sequence):
    """Whether the gate holds this frame until it gives up."""
    begin = time.monotonic()
    gate.wait(pad, sequence)
    return time.monotonic() - begin > 0.1


def test_a_gate_counts_frames_under_way_and_not_numbers_left_out(gate):
    assert not any(waits(gate, 'left', number) for number in range(0, 10 * WINDOW, 10))
    assert waits(gate, 'left', 10 * WINDOW)


def test_a_pad_without_a_classifier_does_not_open_the_gate_of_another_one(gate):
    for number in range(WINDOW):
        gate.wait('left', number)
        gate.wait('right', number)
    assert waits(gate, 'right', WINDOW)
    assert waits(gate, 'left', WINDOW)


def test_a_gate_closes_again_with_the_first_answer(gate):
    for number in range(WINDOW):
        gate.wait('left', number)
    assert waits(gate, 'left', WINDOW) and not waits(gate, 'left', WINDOW + 1)
    gate._on_progress('left', Progress(sequence=1))
    assert waits(gate, 'left', WINDOW + 2)


def test_a_released_gate_lets_a_waiting_log_go_at_once(gate, monkeypatch):
    monkeypatch.setattr(replay, 'TIMEOUT', TIMEOUT)
    for number in range(WINDOW):
        gate.wait('left', number)
    threading.Timer(0.2, gate.release).start()
    begin = time.monotonic()
    gate.wait('left', WINDOW)
    assert time.monotonic() - begin < TIMEOUT / 4
    gate.hold()
    threading.Timer(0.2, gate.release).start()
    assert waits(gate, 'left', WINDOW + 1)


def replaying(bench, path, frames):
    """A driver that plays a log of these frames as fast as it can, without loss."""
    write_log(path, frames)
    given = {'replay': str(path), 'replay_pace': 0.0, 'pads': ['pad'], 'node_ids': [NODE_ID], 'lossless': True}
    return bench.add(DriverNode(parameter_overrides=parameters(given)))


def parameters(values):
    return [Parameter(name, value=value) for name, value in values.items()]


def test_a_replay_that_waits_can_be_deactivated_at_once(ros, tmp_path):
    """Its thread waited for progress that the same executor would have brought: 10 s, and frames were lost."""
    driver = replaying(RosBench(ros), tmp_path / 'long.log', [np.zeros((16, 16), np.uint8)] * (2 * WINDOW))
    driver.autostart()
    assert wait_until(lambda: driver.source.statistics().pads['pad'].published >= WINDOW)
    begin = time.monotonic()
    driver.trigger_deactivate()
    assert time.monotonic() - begin < replay.TIMEOUT / 4


def test_a_replay_as_fast_as_possible_answers_every_frame(ros, tmp_path):
    """More frames than may be under way at once: the driver waits for the progress of the last stage."""
    press, bench, shapes = np.zeros((16, 16), np.uint8), RosBench(ros), []
    press[4:11, 5:12] = 120
    bench.add(ProcessorNode(namespace='/pad', parameter_overrides=parameters({'lossless': True})))
    bench.add(ClassifierNode(namespace='/pad', parameter_overrides=parameters({'lossless': True, 'fit': False})))
    driver = replaying(bench, tmp_path / 'long.log', [press * (number // 50 % 2) for number in range(REPLAYED)])
    bench.add('listener').create_subscription(ContactShape, '/pad/shape', lambda shape: shapes.append(shape.sequence),
                                              frames_qos(50, lossless=True))
    driver.autostart()
    end = time.monotonic() + max(TIMEOUT, REPLAYED / 20)
    while len(shapes) < REPLAYED and time.monotonic() < end:
        bench.executor.spin_once(timeout_sec=0.1)
    assert shapes == list(range(REPLAYED))
