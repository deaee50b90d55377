"""The example node for skins that do not use CANopen.

The example must recognise a shape on such a skin, and publish NaN for taxels without a value.
"""

import os
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from itertools import chain
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import other_skin as example
import pytest
import rclpy
from builtin_interfaces.msg import Duration, Time
from documented_commands import commands_of
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image
from std_msgs.msg import Float32MultiArray, Header

from tactile_node.grasp.trust import Doubt, doubt
from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.processor_node import ProcessorNode
from tactile_node.nodes.spinner import spinning
from tactile_node.nodes.topic_source import TopicSource
from tactile_node.ros.message_checks import check_taxel_array
from tactile_node.ros.qos import frames_qos
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import Contact
from tactile_skin.msg import ContactShape, Grasp, TaxelArray

pytestmark = pytest.mark.ros

ROWS, COLS, PITCH, SIDE, REST, COUNT, TIMEOUT = 12, 14, 0.004, 6.0, 300, 25.0, 60.0
DEAD = (2, 3)
ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / 'docs' / 'howto' / 'other_skins.md').read_text(encoding='utf-8')


@pytest.fixture(autouse=True)
def context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


def counts(contact, seed):
    """Return a frame of a skin whose counts fall by one for each 25 Pa of pressure.

    One taxel of the skin has no value.
    """
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
    """The message StaticData of robotiq_tsf has two pads of 28 numbers each.

    The message SensStream of xela_server_ros2 has forces along x, y and z [N].
    """
    static = SimpleNamespace(taxels=[SimpleNamespace(values=[1] * 28), SimpleNamespace(values=[2] * 28)])
    forces = [SimpleNamespace(x=9.0, y=9.0, z=float(z)) for z in range(16)]
    stream = SimpleNamespace(sensors=[SimpleNamespace(sensor_pos=2, forces=forces)])
    assert list(example.SOURCES['robotiq'][2](static, 1)) == [2] * 28
    assert example.SOURCES['xela'][2](stream, 1) == [float(z) for z in range(16)]
    assert example.SOURCES['xela'][2](stream, 0) == []  # The message has no values for the sensor of this pad.


@pytest.mark.parametrize('order', ['<', '>'])
def test_an_image_is_read_with_its_steps_and_byte_order_and_of_another_encoding_nothing(order):
    padded = np.arange(10, dtype=f'{order}f4').reshape(2, 5)
    image = Image(height=2, width=3, encoding='32FC1', is_bigendian=order == '>', step=20, data=padded.tobytes())
    assert example.pixels(image).tolist() == [[0, 1, 2], [5, 6, 7]]
    assert example.pixels(Image(height=2, width=3, encoding='32SC1', step=20, data=padded.tobytes())).size == 0


def test_rows_are_reversed_on_request_and_a_grid_of_other_sides_is_dropped():
    node, sent = other_skin(rows=2, cols=3, scale=1.0, flip=True), []
    node._publisher = SimpleNamespace(publish=sent.append)
    for _ in range(example.ZERO_FRAMES):
        node.take(np.zeros(6))
    node.take(np.zeros((3, 2)))
    assert not sent
    node.take(range(6))
    assert list(sent[0].values) == [3, 4, 5, 0, 1, 2]
    node.destroy_node()


@pytest.mark.parametrize(('field', 'wrong'), [
    ('header.stamp', Header(stamp=Time(sec=-1))), ('age', Duration(sec=-1)), ('rows', 0), ('cols', 2000),
    ('pitch', 0.0), ('unit', 'counts'), ('unit', ''), ('values', [0.0]), ('values', [np.inf, 0.0]), ('status', [1]),
    ('status', [1, 7]), ('status', [1, 2])])
def test_the_page_names_beside_a_field_for_which_reason_a_wrong_one_is_dropped(field, wrong):
    row = next(line.split('|') for line in PAGE.splitlines() if line.startswith('| ') and f'`{field}`' in
               line.split('|')[1])
    message = TaxelArray(rows=1, cols=2, pitch=0.002, unit='Pa', values=[0.0, 0.0], status=[1, 1])
    assert check_taxel_array(message) is None
    setattr(message, field.split('.')[0], wrong)
    assert f'`{check_taxel_array(message).key}`' in row[3]


@pytest.mark.bus
def test_two_serial_devices_started_as_on_the_page_give_a_view_and_a_grasp(monkeypatch):
    """A square is pressed between both pads. Pseudo-terminals stand in for the serial ports of the devices."""
    words = next(each.words[1:] for each in commands_of(PAGE, '') if 'other_skin.py' in each.text)
    pressures = pressure_frame(Contact('square', (SIDE,), 3.6, 5.4, 0.2), np.random.default_rng(1), 12, 8)
    rng, keyboards, grasps = np.random.default_rng(20261125), [], []
    with ExitStack() as stack:
        def start(*words):
            process = subprocess.Popen([sys.executable, *words], cwd=ROOT)
            stack.callback(process.wait, TIMEOUT)
            stack.callback(process.terminate)
        for pad in ('left', 'right'):
            keyboard, port = os.openpty()
            keyboards.append(keyboard)
            start(*[word.replace('/dev/ttyACM0', os.ttyname(port)).replace('/left', f'/{pad}') for word in words])
        start('-m', 'tactile_node.cli.main', 'bringup', '--side', 'perception', '--pads', 'left,right')
        peer = rclpy.create_node('peer')
        peer.create_subscription(Grasp, '/grasp', grasps.append, frames_qos(1))
        stack.callback(peer.destroy_node)
        stack.enter_context(spinning([peer]))

        def send_until(condition, load):
            end = time.monotonic() + TIMEOUT
            while not condition():
                assert time.monotonic() < end, grasps[-1:]
                for keyboard, pressed in zip(keyboards, (pressures, pressures[:, ::-1])):
                    counts = np.rint(400 + load * pressed / pressures.max()
                                     + 4 * rng.standard_normal(pressed.shape)).astype(int)
                    os.write(keyboard, ' '.join(map(str, counts.ravel())).encode() + b'\n')
                time.sleep(0.08)  # Even a busy machine can process this many frames per second.
        send_until(lambda: grasps and grasps[-1].contact == Grasp.NO_CONTACT, 0)
        monkeypatch.setattr(rclpy, 'init', lambda **given: None)  # ROS is already initialised.
        view = TopicSource()
        stack.callback(view.stop)
        view.start()
        send_until(lambda: doubt(grasps[-1], 0.0) is Doubt.NONE and grasps[-1].class_name == 'square', 1200)
        shown = view.store.shown().pads
        assert {pad: state.contact.shape for pad, state in shown.items()} == {'left': 'square', 'right': 'square'}


def ended(monkeypatch, capfd, *parameters):
    """Run the example as a program, and return its exit code and the last line that it prints."""
    rclpy.try_shutdown()  # The example initialises ROS itself.
    monkeypatch.setattr(sys, 'argv', ['other_skin.py', '--ros-args', *chain(*(('-p', each) for each in parameters))])
    code = example.main()
    printed = capfd.readouterr().err
    assert 'Traceback' not in printed
    return code, printed.splitlines()[-1]


@pytest.mark.parametrize(('parameters', 'parts'), [
    (['source:=telepathy'], ['parameter source: expected one of ', 'serial', "got 'telepathy'"]),
    (['source:=robotiq'], ['parameter source: expected the messages of robotiq_tsf', 'Source the workspace']),
    (['source:=serial', 'port:=/nowhere/skin'], ['parameter port: expected a serial port that opens', '/nowhere/skin']),
    (['source:=serial', 'port:=/dev/null', 'baud_rate:=-1'], ['parameter port: expected a serial port that opens']),
    (['rows:=many'], ['parameter', 'rows', 'integer'])])
def test_an_unusable_parameter_causes_one_sentence_and_exit_code_2(parameters, parts, monkeypatch, capfd):
    code, error = ended(monkeypatch, capfd, *parameters)
    assert code == 2 and error.startswith('other_skin: error: ') and all(part in error.lower() for part in map(
        str.lower, parts)), error


def test_a_serial_device_that_is_pulled_out_ends_the_example_with_one_sentence(monkeypatch, capfd):
    keyboard, port = os.openpty()
    name, came = os.ttyname(port), threading.Event()
    monkeypatch.setattr(example.OtherSkin, 'take', lambda self, numbers: came.set())

    def send_until_it_comes_and_pull_out():
        while not came.wait(0.01):
            os.write(keyboard, b'1 2 3\n')
        os.close(port)
        os.close(keyboard)
    threading.Thread(target=send_until_it_comes_and_pull_out, daemon=True).start()
    code, error = ended(monkeypatch, capfd, 'source:=serial', f'port:={name}')
    assert code == 2 and f'serial port {name}: expected to receive' in error


def test_lines_of_a_serial_port_are_frames_and_a_word_that_is_no_number_is_nan():
    keyboard, port = os.openpty()
    node, sent = other_skin(source='serial', port=os.ttyname(port), rows=1, cols=3), []
    node._publisher = SimpleNamespace(publish=sent.append)
    reading = threading.Thread(target=node.read_serial)
    reading.start()
    end = time.monotonic() + TIMEOUT
    # The example first reads the lines at rest that are still queued in the port.
    while not (sent and sent[-1].values[0]):
        assert time.monotonic() < end
        os.write(keyboard, b'300, 300 300\n' if len(node._first) < example.ZERO_FRAMES else b'296, 1x 300\n')
        time.sleep(0.01)
    rclpy.shutdown()
    reading.join()
    assert list(sent[-1].values)[::2] == [4 * COUNT, 0.0] and np.isnan(sent[-1].values[1])
