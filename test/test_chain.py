"""Tests that replay a recorded log of real touches through driver, processor and classifier in one process.

A listener receives the messages of these nodes over DDS.
"""

import time
from contextlib import ExitStack
from threading import Event

import pytest
import rclpy
from candump import DATA, read_candump

from tactile_node.node_graph import Parameters, bus_nodes
from tactile_node.nodes.spinner import spinning
from tactile_node.nodes.system import System
from tactile_node.ros.qos import frames_qos
from tactile_skin.msg import ContactFeatures, ContactShape, TaxelArray

pytestmark = [pytest.mark.ros, pytest.mark.bus]

LOG = 'nus_ring_session.log.gz'
LAYOUT = 'nus_sinapse_64x64.yaml'
NODE_ID = 32  # node-ID of the skin in the log
TPDOS = 64    # number of TPDOs that answer a SYNC
SYNC = 0x080
TIMEOUT = 240.0  # Timeout for the replay, long enough for a busy machine [s].


class Listener:
    """Collects all messages of the three topics in the order of their arrival."""

    def __init__(self):
        self.node = rclpy.create_node('listener')
        self.heard = {name: [] for name in ('taxels', 'features', 'shape')}
        qos = frames_qos(50, lossless=True)
        for name, kind in zip(self.heard, (TaxelArray, ContactFeatures, ContactShape)):
            self.node.create_subscription(kind, f'/hand/finger/{name}', self.heard[name].append, qos)

    def wait_for(self, count: int) -> None:
        """Spin until ``count`` messages have arrived on every topic."""
        deadline = time.monotonic() + TIMEOUT
        while min(map(len, self.heard.values())) < count and time.monotonic() < deadline:
            rclpy.spin_once(self.node, timeout_sec=0.1)


@pytest.fixture(scope='module')
def heard() -> dict:
    """Replay LOG as fast as possible, and return the messages of the three topics."""
    periods = sum(line.can_id == SYNC for line in read_candump(LOG))
    driver: Parameters = {'replay': str(DATA / LOG), 'replay_pace': 0.0, 'node_ids': [NODE_ID], 'layouts': [LAYOUT]}
    with ExitStack() as stack:
        rclpy.init()
        stack.callback(rclpy.shutdown)
        system = System(bus_nodes(['finger'], driver=driver, every={'lossless': True}, namespace='hand'))
        listener = Listener()
        stack.callback(listener.node.destroy_node)
        stack.callback(system.destroy)
        stack.enter_context(spinning(system.nodes))
        system.autostart(Event())
        listener.wait_for(periods)
    return listener.heard


@pytest.fixture(scope='module')
def syncs() -> list[float]:
    return [line.stamp for line in read_candump(LOG) if line.can_id == SYNC]


def seconds(message) -> float:
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9


@pytest.mark.parametrize('topic', ['taxels', 'features', 'shape'])
def test_every_sync_period_comes_out_once_in_order_with_its_own_stamp(heard, syncs, topic):
    messages = heard[topic]
    assert [message.sequence for message in messages] == list(range(len(syncs)))
    assert [seconds(message) for message in messages] == pytest.approx(syncs, abs=1e-6)
    assert {message.header.frame_id for message in messages} == {'finger_pad'}


def test_every_tpdo_of_the_log_is_published_or_counted_as_missing(heard, syncs):
    lines = read_candump(LOG)
    bases = {0x180, 0x280, 0x380, 0x480}
    tpdos = sum((line.can_id & 0x780) in bases and len(line.data) == 8 for line in lines)
    missing = sum(message.missing_can_frames for message in heard['taxels'])
    assert tpdos + missing == len(syncs) * TPDOS
    assert tpdos > 0


def test_taxels_are_the_bits_of_the_log(heard, syncs):
    """The test decodes the middle frame without the code under test.

    The TPDO of row r holds the 64 taxels of that row, and bit 0 is the first taxel.
    """
    lines, middle = read_candump(LOG), len(syncs) // 2
    begin, end = (next(i for i, line in enumerate(lines) if line.can_id == SYNC and line.stamp == stamp)
                  for stamp in syncs[middle:middle + 2])
    rows = [line for line in lines[begin + 1:end] if len(line.data) == 8 and line.can_id & 0x780 in
            (0x180, 0x280, 0x380, 0x480)]
    rows.sort(key=lambda line: line.can_id)
    expected = [float(int.from_bytes(line.data, 'little') >> bit & 1) for line in rows for bit in range(64)]
    message = heard['taxels'][middle]
    assert list(message.values) == expected
    assert (message.rows, message.cols, message.unit) == (64, 64, '1')
    assert 20 < sum(expected) < 400


def test_shape_is_of_the_same_contact_as_features(heard):
    for features, shape in zip(heard['features'], heard['shape']):
        pieces_are_joined = shape.contacts < features.contacts
        assert shape.taxels > sum(features.pattern) if pieces_are_joined else shape.taxels == sum(features.pattern)
        assert sum(shape.probabilities) == pytest.approx(1, abs=1e-5)
        assert (shape.shape == ContactShape.NONE) == (shape.taxels == 0)
        assert (shape.frame_shape == ContactShape.UNKNOWN) >= (0 < shape.taxels < 3)
