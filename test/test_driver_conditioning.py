"""Tests for conditioning in the driver node, which a user sets by files, services and live parameters."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rclpy
from driver_bench import WARN, DriverBench
from fault_bench import LAYOUT, PRESSED, SIDE, FaultBench
from rclpy.lifecycle import TransitionCallbackReturn
from std_srvs.srv import Trigger

from tactile_node.conditioning.faulty_taxels_file import load_faults
from tactile_node.conditioning.gain import make_curve
from tactile_node.conditioning.taxel_faults import TaxelFault
from tactile_node.errors import ConfigurationError
from tactile_node.learning.response import SkinResponse, save_response
from tactile_node.nodes import driver_node
from tactile_node.nodes.driver_source import driver_pads, make_source
from tactile_node.package_files import config_path
from tactile_node.pose.profiles import Layer
from tactile_node.ros.conditioning_setup import conditioned_pads, skin_responses
from tactile_node.ros.settings import DriverSettings
from tactile_node.taxel_frame import TaxelFrame
from tactile_skin.msg import FaultyTaxel, NodeStatus, SkinStatus, TaxelArray

pytestmark = [pytest.mark.ros, pytest.mark.bus]

FILE = 'pads: {pad32: {dead: [[2, 3]]}}'


class Driver(DriverBench):
    """Driver of a simulated pad on which every taxel reads PRESSED."""

    def values(self):
        """Return the values of the next complete frame that was not already on its way."""
        for _ in range(10):
            self.executor.spin_once(timeout_sec=0.0)
        self.taxels.clear()
        self.until(lambda: any(not message.missing_can_frames for message in self.taxels))
        message = next(message for message in self.taxels if not message.missing_can_frames)
        return np.array(message.values).reshape(SIDE, SIDE)


@pytest.fixture
def make(ros):
    bench = ros.enter_context(FaultBench('conditioning', source=lambda t: np.full((SIDE, SIDE), PRESSED)))

    def driver(**given):
        made = Driver(ros, bench, **given)
        made.node.autostart()
        return made
    return driver


def test_files_act_from_the_first_frame_and_are_reported(make, tmp_path):
    faults, gains = tmp_path / 'faults.yaml', tmp_path / 'gains.txt'
    faults.write_text(FILE)
    np.savetxt(gains, np.full((SIDE, SIDE), 2.0))
    driver = make(faulty_taxels_file=str(faults), gain_files=[str(gains)])
    values = driver.values()
    assert np.isnan(values[2, 3]) and np.count_nonzero(np.isnan(values)) == 1
    np.testing.assert_allclose(values[0], 2 * PRESSED, rtol=1e-3)
    driver.until(lambda: any(status.pads and status.pads[0].faulty_taxels for status in driver.status))
    faulty, = driver.status[-1].pads[0].faulty_taxels
    assert (faulty.row, faulty.col, faulty.code, faulty.fault) == (2, 3, FaultyTaxel.DEAD, 'dead')
    driver.until(lambda: any(levels[1] == WARN and 'dead: (2, 3)' in report
                             for levels, report in zip(driver.levels, driver.reports) if len(levels) > 1))


def test_a_calibrated_skin_publishes_pressures_and_its_layer(make, tmp_path):
    path = tmp_path / 'skin.response.yaml'
    curve = make_curve([0, PRESSED / 2, 2 * PRESSED], [0, PRESSED / 4, PRESSED])
    save_response(path, SkinResponse('N', Layer(0.0015, 0.1), curve), 'of a test', {})
    driver = make(response_files=[str(path)])
    np.testing.assert_allclose(driver.values(), PRESSED / 2, rtol=1e-2)
    message = driver.taxels[-1]
    assert (message.layer_depth, message.layer_deviation) == pytest.approx((0.0015, 0.1))


def test_the_sides_at_which_the_finger_ends_are_those_of_the_layout(make, tmp_path):
    layout = Path(config_path(LAYOUT))
    path = tmp_path / 'finger.yaml'
    path.write_text(layout.read_text() + '\nfinger_ends: [last_row, first_col]\n')
    path.with_suffix('.eds').write_bytes(layout.with_suffix('.eds').read_bytes())
    driver = make(layouts=[str(path)])
    driver.values()
    assert driver.taxels[-1].finger_ends == TaxelArray.LAST_ROW | TaxelArray.FIRST_COL


def test_a_response_to_another_unit_is_refused(tmp_path):
    path = tmp_path / 'skin.response.yaml'
    save_response(path, SkinResponse('N', Layer(0.0015, 0.1), make_curve([0, 1], [0, 1])), 'of a test', {})
    settings = DriverSettings(response_files=(str(path),), replay='a log')
    with pytest.raises(ConfigurationError, match="'N'"):
        skin_responses(driver_pads(settings), settings)


def test_faults_are_saved_on_request(make, tmp_path):
    faults = tmp_path / 'faults.yaml'
    faults.write_text(FILE.replace('[2, 3]', '[4, 5]'))
    driver = make(faulty_taxels_file=str(faults))
    faults.unlink()
    answer = driver.answer(Trigger, 'save_faulty_taxels', Trigger.Request())
    assert answer.success and '1 faulty' in answer.message
    assert load_faults(faults, {'pad32': (SIDE, SIDE)})['pad32'].places(TaxelFault.DEAD) == [(4, 5)]


def test_without_a_file_saving_names_what_to_set(make):
    answer = make().answer(Trigger, 'save_faulty_taxels', Trigger.Request())
    assert not answer.success and 'faulty_taxels_file' in answer.message


def test_changes_take_effect_live_or_are_refused_with_a_reason(make, tmp_path):
    faults = tmp_path / 'faults.yaml'
    faults.write_text(FILE)
    driver = make(faulty_taxels_file=str(faults))
    assert driver.set('faulty_taxels', 'mask').successful
    assert driver.node._pads['pad32'].conditioned.masks
    refused = driver.set('faulty_taxels', 'hide')
    assert not refused.successful and 'mask or report' in refused.reason
    assert not driver.set('heartbeat_timeout', 0.01).successful
    assert driver.set('follow_drift', True).successful
    drift = driver.node._pads['pad32'].conditioned.tared.drift
    assert driver.set('tare_limit', 0.02).successful and drift.limit == 0.02
    # With a higher drift limit, the zero would follow a grasp.
    assert driver.set('tare_limit', 50.0).successful and drift.limit == 0.03
    # The simulated skin reads the same values for ever, so the pad counts as frozen.
    assert driver.set('frozen_after', 0.1).successful
    driver.taxels.clear()
    driver.until(lambda: driver.taxels and np.isnan(driver.taxels[-1].values).all())
    assert driver.set('frozen_after', 0.0).successful
    driver.until(lambda: not np.isnan(driver.taxels[-1].values).all())


def test_how_long_a_node_may_be_silent_can_be_changed_live(make):
    driver = make()
    driver.until(lambda: driver.status and driver.status[-1].active)
    assert driver.set('heartbeat_timeout', 30.0).successful
    driver.bench.device.power_off()
    driver.until(lambda: driver.status[-1].pads[0].nodes[0].heartbeat_age > 2)
    assert driver.status[-1].pads[0].nodes[0].fault == NodeStatus.FAULT_NONE
    assert driver.set('heartbeat_timeout', 0.5).successful
    driver.until(lambda: driver.status[-1].pads[0].nodes[0].fault == NodeStatus.FAULT_SILENT)


def test_a_live_change_and_configure_refuse_the_same_heartbeat_timeout(make):
    driver = make(heartbeat_period=0.25)
    refused = driver.set('heartbeat_timeout', 0.45)
    assert not refused.successful and 'a timeout of 2 periods or more' in refused.reason
    assert driver.node.get_parameter('heartbeat_timeout').value == DriverSettings().heartbeat_timeout
    assert driver.set('heartbeat_timeout', 0.55).successful
    for again in (driver.node.trigger_deactivate, driver.node.trigger_cleanup, driver.node.trigger_configure):
        assert again() == TransitionCallbackReturn.SUCCESS
    assert driver.node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    assert driver.set('heartbeat_timeout', 0.45).successful, 'a timeout may change before configure checks both values'
    assert driver.node.trigger_configure() == TransitionCallbackReturn.FAILURE


def test_a_live_change_while_the_driver_configures_takes_effect(make, monkeypatch):
    """After reading the parameters, configure takes several seconds.

    A parameter that changes during this time must still take effect.
    """
    driver = make(autostart=False)

    def set_and_make_source(*given):
        assert driver.set('faulty_taxels', 'mask').successful
        return make_source(*given)
    monkeypatch.setattr(driver_node, 'make_source', set_and_make_source)
    assert driver.node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    assert driver.node._pads['pad32'].conditioned.masks


def test_another_publisher_of_the_pads_taxels_is_reported(make):
    """If a user starts the driver twice, both publishers have the same node name."""
    driver = make()
    driver.until(lambda: driver.status and driver.status[-1].pads and driver.status[-1].pads[0].level == SkinStatus.OK)
    with rclpy.context.Context() as context:  # The second context acts as another process.
        other = rclpy.create_node('skin_driver', context=context)
        other.create_publisher(TaxelArray, '/pad32/taxels', 10)
        driver.until(lambda: driver.status[-1].pads[0].level == SkinStatus.WARN
                    and '/skin_driver' in driver.status[-1].pads[0].message)
        other.destroy_node()
    driver.until(lambda: driver.status[-1].pads[0].level == SkinStatus.OK)


def test_incomplete_frames_can_be_dropped_live(make):
    driver = make()
    driver.values()
    driver.bench.adapter.tamper = lambda message: [] if message.arbitration_id == 0x1A0 else [message]
    driver.until(lambda: driver.taxels[-1].missing_can_frames == 1)
    assert driver.set('drop_incomplete', True).successful

    def lost():
        pad = driver.status[-1].pads[0]
        return pad.loss_counts[pad.loss_reasons.index('incomplete')]
    driver.until(lost)
    driver.bench.adapter.tamper = None
    driver.values()


@pytest.mark.parametrize(('gain', 'reading'), [(1.0, 40e3), (10.0, 4e3)])
def test_no_tare_limit_lets_the_zero_follow_a_grasp(tmp_path, gain, reading):
    """With either gain, the conditioned skin reads 40 kPa for a minute."""
    np.savetxt(tmp_path / 'gains.txt', np.full((16, 16), gain))
    settings = DriverSettings(follow_drift=True, tare_limit=1e9, gain_files=(str(tmp_path / 'gains.txt'),))
    pad = conditioned_pads(driver_pads(replace(settings, replay='a log')), settings)['pad']
    for n in range(600):
        values = np.full((16, 16), reading if n > 50 else 0.0, np.float32)
        last = pad.feed(TaxelFrame(0.1 * n, n, values, np.zeros((16, 16), np.uint8), missing_can_frames=0))
    np.testing.assert_allclose(last.values, 40e3, rtol=0.01)
