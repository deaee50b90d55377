"""The nodes of a bus are looked after at once: what one of them takes its time for costs the others none."""

import threading

import pytest
from fault_bench import TIMEOUT, FaultBench

from tactile_node.bus.skin_bus import SkinBus
from tactile_node.errors import DeviceAbsentError

pytestmark = pytest.mark.bus


def test_nodes_are_configured_at_once(monkeypatch):
    both, configure = threading.Barrier(2, timeout=TIMEOUT), SkinBus.configure_node

    def configure_when_both_are(bus, *given):
        both.wait()
        return configure(bus, *given)
    with FaultBench('at once', nodes=(32, 64)) as bench:
        monkeypatch.setattr(SkinBus, 'configure_node', configure_when_both_are)
        bench.run()
        bench.wait_for_whole('pad64')


def test_of_absent_nodes_that_are_not_waited_for_one_is_named():
    with FaultBench('both absent', nodes=(32, 64), boot_timeout=0.3) as bench:
        for device in bench.simulator.devices.values():
            device.power_off()
        bench.driver.open()
        with pytest.raises(DeviceAbsentError, match='node 32'):
            bench.driver.configure()
