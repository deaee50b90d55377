"""A serial adapter pulled out under the driver and put in again: another device file, by the same name."""

import time

import numpy as np
import pytest
from can_bench import wait_until

from tactile_node.assembly.health import BusFault
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.slcan_pty import SlcanPty
from tactile_node.skin.pads import make_pads, with_dictionaries
from tactile_node.sources.supervisor import Supervisor

pytestmark = pytest.mark.bus

PADS = with_dictionaries(make_pads(['sim8x8_16bit.yaml'], [32]))


def plugged(link) -> SkinSimulator:
    simulator = SkinSimulator(PADS, {'pad32': lambda t: np.full((8, 8), 12.5)})
    simulator.start_on(SlcanPty(str(link)))
    return simulator


def test_an_adapter_that_was_pulled_out_is_used_as_soon_as_it_is_back(tmp_path, caplog):
    frames = []
    driver = Supervisor(BusSettings('slcan', str(tmp_path / 'skin'), sync_period=0.05), PADS,
                        lambda _name, frame: frames.append(frame))

    def whole(since):
        return any(frame.stamp > since and not frame.missing_can_frames for frame in tuple(frames))
    simulator = plugged(tmp_path / 'skin')
    try:
        driver.open()
        driver.configure()
        driver.start()
        assert wait_until(lambda: whole(0))
        simulator.stop()
        assert wait_until(lambda: driver.failure is not None)
        assert wait_until(lambda: any(isinstance(getattr(record, 'fact', None), BusFault) for record in caplog.records))
        simulator, back = plugged(tmp_path / 'skin'), time.time()
        assert wait_until(lambda: whole(back)), caplog.messages
        assert wait_until(lambda: driver.failure is None and driver.health().outages.count == 1)
    finally:
        driver.close()
        simulator.stop()
    assert (np.diff([frame.sequence for frame in frames]) > 0).all()
    assert (np.diff([frame.stamp for frame in frames]) > 0).all()
    assert all(np.allclose(frame.values[np.isfinite(frame.values)], 12.5) for frame in frames)
