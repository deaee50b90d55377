"""The example for skins that are not on CANopen: its taxels are recognised, and what has no value is NaN."""

import os
import threading
import time
from types import SimpleNamespace

import numpy as np
import other_skin as example
import pytest
import rclpy
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float32MultiArray

from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.processor_node import ProcessorNode
from tactile_node.nodes.spinning import spinning
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import Contact
from tactile_skin.msg import ContactShape, TaxelArray

pytestmark = pytest.mark.ros

ROWS, COLS, PITCH, SIDE, REST, COUNT, TIMEOUT = 12, 14, 0.004, 6.0, 300, 25.0, 60.0
DEAD = (2, 3)


@pytest.fixture(autouse=True)
def context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


def counts(contact, seed):
    """A frame of a skin whose counts fall by one for each 25 Pa, with a taxel that has no value."""
    pressures = pressure_frame(contact, np.random.default_rng(seed), ROWS, COLS, skin=Skin(noise=0.003))
    frame = np.rint(REST - pressures / COUNT)
    frame[DEAD] = np.nan
    return frame


def other_skin(**settings):
    parameters = {'rows': ROWS, 'cols': COLS, 'pitch': PITCH, 'scale': -COUNT, **settings}
    return example.OtherSkin(namespace='/left', parameter_overrides=[
        Parameter(name, value=value) for name, value in parameters.items()])


def test_a_square_on_an_array_of_counts_is_recognised():
    node, peer = other_skin(), rclpy.create_node('peer')
    nodes = [node, peer, ProcessorNode(namespace='/left'), ClassifierNode(namespace='/left')]
    raw = peer.create_publisher(Float32MultiArray, '/left/raw', qos_profile_sensor_data)
    arrays, shapes = [], []
    peer.create_subscription(TaxelArray, '/left/taxels', arrays.append, 10)
    peer.create_subscription(ContactShape, '/left/shape', shapes.append, 10)
    with spinning(nodes):
        end, seed = time.monotonic() + TIMEOUT, 0
        while not (shapes and shapes[-1].class_name == 'square' and shapes[-1].confidence > 0.9):
            assert time.monotonic() < end, shapes[-1:]
            is_pressed = len(shapes) > 10
            raw.publish(Float32MultiArray(data=counts(
                Contact('square', (SIDE,), 7.2, 5.8, 0.3) if is_pressed else None, seed).ravel().tolist()))
            seed += 1
            time.sleep(0.02)
    assert shapes[-1].dimensions[0] == pytest.approx(SIDE * PITCH, rel=0.1)
    values = np.reshape(arrays[-1].values, (ROWS, COLS))
    assert np.isnan(values[DEAD]) and np.reshape(arrays[-1].status, (ROWS, COLS))[DEAD] == TaxelArray.STALE
    assert np.count_nonzero(np.isnan(values)) == 1
    for each in nodes:
        each.destroy_node()


def test_frames_of_another_size_are_dropped_and_leave_a_gap():
    node, sent = other_skin(), []
    node._publisher = SimpleNamespace(publish=sent.append)
    for _ in range(example.ZERO_FRAMES):
        node.take(np.full(ROWS * COLS, REST))
    for numbers in (np.full(ROWS * COLS, REST - 4), [1.0, 2.0], np.full(ROWS * COLS, REST - 8)):
        node.take(numbers)
    assert [message.sequence - sent[0].sequence for message in sent] == [0, 2]
    assert [set(message.values) for message in sent] == [{4 * COUNT}, {8 * COUNT}]
    node.destroy_node()


def test_messages_of_makers_are_read():
    """StaticData of robotiq_tsf: two pads of 28 numbers; SensStream of xela_server_ros2: forces along x, y, z [N]."""
    static = SimpleNamespace(taxels=[SimpleNamespace(values=[1] * 28), SimpleNamespace(values=[2] * 28)])
    forces = [SimpleNamespace(x=9.0, y=9.0, z=float(z)) for z in range(16)]
    stream = SimpleNamespace(sensors=[SimpleNamespace(forces=[]), SimpleNamespace(forces=forces)])
    assert list(example.SOURCES['robotiq'][2](static, 1)) == [2] * 28
    assert example.SOURCES['xela'][2](stream, 1) == [float(z) for z in range(16)]


def test_lines_of_a_serial_port_are_frames_and_a_word_that_is_no_number_is_nan():
    keyboard, port = os.openpty()
    node, sent = other_skin(source='serial', port=os.ttyname(port), rows=1, cols=3), []
    node._publisher = SimpleNamespace(publish=sent.append)
    reading = threading.Thread(target=node.read_serial)
    reading.start()
    end = time.monotonic() + TIMEOUT
    while not sent:
        assert time.monotonic() < end
        os.write(keyboard, b'300, 300 300\n' if len(node._first) < example.ZERO_FRAMES else b'296, 1x 300\n')
        time.sleep(0.01)
    rclpy.shutdown()
    reading.join()
    assert list(sent[0].values)[::2] == [4 * COUNT, 0.0] and np.isnan(sent[0].values[1])
