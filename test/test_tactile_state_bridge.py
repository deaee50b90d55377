"""The bridge to tactile_msgs/TactileState: a taxel without a value becomes NaN, never 0."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tactile_state_bridge as bridge
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_bench import RosBench

from tactile_node.pose.pipeline import Taxels
from tactile_node.ros.contact_messages import PadFrame, taxel_array_message
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus
from tactile_skin.msg import TaxelArray

pytestmark = [pytest.mark.ros, pytest.mark.bus]

PATH = Path(__file__).resolve().parents[1] / 'examples' / 'tactile_state_bridge.py'
VALUES = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]


def taxels(hidden=None, code=TaxelStatus.STALE):
    values, status = np.array(VALUES, np.float32), np.full((2, 3), TaxelStatus.VALID, np.uint8)
    if hidden is not None:
        values[hidden], status[hidden] = np.nan, code
    return taxel_array_message(PadFrame.of(TaxelFrame(1.7e9 + 0.25, 7, values, status, 0), Taxels(0.002, 'Pa'),
                                           'left_pad'))


def test_a_pad_is_a_sensor_row_by_row_with_its_stamp(tactile_state_message):
    state = bridge.tactile_state(taxels(), 'left')
    sensor, = state.sensors
    assert isinstance(state, tactile_state_message) and state.header == taxels().header
    assert (sensor.name, list(sensor.values)) == ('left', [1, 2, 3, 4, 5, 6])


@pytest.mark.parametrize('code', [TaxelStatus.STALE, TaxelStatus.DEAD, TaxelStatus.FAULTY])
def test_a_taxel_without_a_value_is_nan_or_its_pad_is_left_out(tactile_state_message, code):
    values = np.array(bridge.tactile_state(taxels((1, 0), code), 'left').sensors[0].values)
    assert np.flatnonzero(np.isnan(values)).tolist() == [3]
    assert bridge.tactile_state(taxels((1, 0), code), 'left', bridge.LEAVE_OUT) is None


def test_places_without_a_taxel_leave_no_pad_out(tactile_state_message):
    assert bridge.tactile_state(taxels((1, 0), TaxelStatus.UNMAPPED), 'left', bridge.LEAVE_OUT) is not None
    assert bridge.tactile_state(taxels(), 'left', bridge.LEAVE_OUT) is not None


def test_the_node_sends_each_pad_and_drops_malformed_messages(ros, tactile_state_message, monkeypatch):
    bench, heard, create_publisher = RosBench(ros), [], Node.create_publisher

    def create(node, kind, topic, *given, **options):
        """Replace publishers of the generated message type, which DDS cannot send in this environment."""
        if kind is not tactile_state_message:
            return create_publisher(node, kind, topic, *given, **options)
        assert topic == 'tactile_states'
        return SimpleNamespace(publish=heard.append)
    monkeypatch.setattr(Node, 'create_publisher', create)
    bench.add(bridge.make_node(parameter_overrides=[Parameter('pads', value=['left', 'right'])]))
    peer = bench.add('peer')
    publishers = [peer.create_publisher(TaxelArray, f'{pad}/taxels', 10) for pad in ('left', 'right')]

    def have_come():
        for publisher in publishers:
            publisher.publish(TaxelArray())  # This message contains no taxels.
            publisher.publish(taxels())
        return len({state.sensors[0].name for state in heard}) == 2
    bench.until(have_come)
    assert all(list(state.sensors[0].values) == [1, 2, 3, 4, 5, 6] for state in heard)
    with pytest.raises(ValueError):
        bridge.make_node(parameter_overrides=[Parameter('nan', value='zero')])


def test_the_bridge_names_a_missing_tactile_msgs():
    program = ('import sys, runpy; sys.modules["tactile_msgs"] = None; '
               f'runpy.run_path({str(PATH)!r}, run_name="__main__")')
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True)
    assert done.returncode == 2 and 'tactile_msgs' in done.stderr and 'Traceback' not in done.stderr
