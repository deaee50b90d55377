"""The driver's reaction to nodes that return, zero themselves, or share a COB-ID."""

import logging
import threading

import numpy as np
import pytest
from can_bench import Bench
from canopen import SdoAbortedError
from fault_bench import TIMEOUT, FaultBench
from waiting import wait_until

from tactile_node.assembly.facts import LossReason
from tactile_node.bus import bus_devices
from tactile_node.bus.skin_bus import SkinBus
from tactile_node.errors import DeviceError, HalfZeroedError
from tactile_node.package_files import config_path
from tactile_node.skin.pads import make_pad
from tactile_node.sources.log_source import LogSource

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


def test_an_eds_without_it_is_reported():
    with Bench('no_zero', 'sim16x16.yaml') as bench:
        bench.driver.open()
        with pytest.raises(DeviceError, match='0x6125.*no such object.*without on_device'):
            bench.driver.devices.auto_zero('pad32')


def test_a_device_that_refuses_is_reported_by_channel(monkeypatch):
    monkeypatch.setattr(bus_devices, 'ZERO_SIGNATURE', b'nero')
    with Bench('refuses_zero', 'sim8x8_16bit.yaml') as bench:
        bench.driver.open()
        with pytest.raises(DeviceError, match='0x6125 sub 1: .*0 of 64 channels are zeroed') as refused:
            bench.driver.devices.auto_zero('pad32')
        assert not isinstance(refused.value, HalfZeroedError)


@pytest.mark.parametrize('answer', [bytes.fromhex('8025610322000008'), None])
def test_a_device_that_is_zeroed_in_part_or_does_not_answer_is_distinguished(answer):
    """Either the device refuses the third channel with an SDO abort, or its confirmation is lost.

    In both cases, the driver must report that only some channels are zeroed.
    """
    def tamper(message):
        if message.arbitration_id == 0x5A0 and bytes(message.data[:4]) == bytes.fromhex('60256103'):
            message.data = answer
            return [message] if answer else []
        return [message]
    with FaultBench(f'half zeroed {answer}') as bench:
        bench.driver.open()
        bench.adapter.tamper = tamper
        with pytest.raises(HalfZeroedError, match='0x6125 sub 3: .*2 of 64 channels are zeroed'):
            bench.driver.auto_zero('pad32')


def test_the_first_node_of_a_pad_may_be_zeroed_when_the_second_refuses(monkeypatch):
    zeroed = []

    def second_refuses(_sdo, _dictionary, label):
        if zeroed:
            raise DeviceError(label, expected='that it takes "zero"', got='an abort', remedy='See its manual.')
        zeroed.append(label)
        return 5
    monkeypatch.setattr(bus_devices, 'auto_zero', second_refuses)
    with Bench('nodes zeroed', 'nodes2_12x8_12bit.yaml', (32, 35)) as bench:
        bench.driver.open()
        with pytest.raises(HalfZeroedError, match='node 35.*5 channels of other nodes are zeroed'):
            bench.driver.devices.auto_zero('pad32')


def test_a_log_has_no_device(tmp_path):
    (tmp_path / 'x.log').touch()
    source = LogSource(str(tmp_path / 'x.log'), (make_pad('pad', 32, 'sim8x8_16bit.yaml'),), lambda *_: None)
    with pytest.raises(DeviceError, match='x.log'):
        source.auto_zero('pad')


#: Layout with only TPDO 3 of the simulated skin, which covers the first half of row 1. TPDO 3 has the COB-ID of the
#: skin's TPDO 1, which covers row 0.
ONE = '''
rows: 1
cols: 4
pitch: 0.004
value: {unit: N, scale: 0.0005, offset: 30000, bits: 16, signed: true, pressure: falling}
tpdos:
- {number: 3, cob_id: $NODEID+0x180, map: {object: 0x7130, sub: 9, bits: 16, count: 4},
   taxels: {first: [0, 0], step: [0, 1], count: 4, bit_step: 16}}
'''
ROWS = np.repeat(np.arange(8.0)[:, None] + 1, 8, axis=1)  # The value of each taxel is its row number plus 1.


def one_tpdo(bench, folder):
    """Return a driver with the layout ONE on the bench's bus."""
    path = folder / 'one.yaml'
    path.write_text(ONE)
    pad = make_pad('pad32', 32, str(path), str(config_path('sim8x8_16bit.eds')))
    return SkinBus(bench.settings, (pad,), lambda name, frame: bench.frames.put((name, frame)))


def cob_id(bench, number):
    """Return the COB-ID of the device's TPDO ``number`` (sub-index 1 of object 0x1800 + number - 1)."""
    return bench.simulator.devices[32]._number(0x1800 + number - 1, 1)


def test_no_other_tpdo_is_taken_for_taxels(tmp_path, caplog):
    """The demo device of CANopenNode once sent two TPDOs with the same COB-ID.

    The driver then read the first of the two as valid taxel values.
    """
    caplog.set_level(logging.WARNING)
    with Bench('rivals', 'sim8x8_16bit.yaml', source=lambda t: ROWS, sync_period=0.02) as bench:
        bench.run()
        bench.take_whole(1)
        bench.driver.close()
        bench.forget()
        bench.driver = one_tpdo(bench, tmp_path)
        bench.run()
        frames = bench.take_whole(3)
        rival, other = cob_id(bench, 1), cob_id(bench, 2)
        losses = bench.driver.facts().pad('pad32').losses
    assert all(np.allclose(frame.values, 2.0) for _, frame in frames)
    assert rival >> 31 == 1 and other >> 31 == 0, 'the rival TPDO must be disabled, and TPDO 2 has another COB-ID'
    # A busy machine may read a CAN frame late.
    assert {reason for reason, count in losses.items() if count} <= {LossReason.LATE} and 'TPDO 1' in caplog.text


def test_a_device_that_refuses_is_not_used(tmp_path):
    def refuse(index, subindex, **_):
        if (index, subindex) == (0x1800, 1):
            raise SdoAbortedError(0x06010002)
    with Bench('stubborn', 'sim8x8_16bit.yaml', source=lambda t: ROWS) as bench:
        bench.run()
        bench.driver.close()
        bench.simulator.devices[32]._node.add_write_callback(refuse)
        bench.driver = one_tpdo(bench, tmp_path)
        bench.driver.open()
        with pytest.raises(DeviceError) as refused:
            bench.driver.configure()
    assert '0x1800 sub 1' in refused.value.where and '0x06010002' in refused.value.got


def test_a_node_whose_mapping_is_another_one_gives_no_value_and_is_left_as_it_was():
    """The node has changed its mapping without sending a boot-up message, and refuses to write another mapping.

    The driver discovers the changed mapping only because it checks the node for another reason.
    """
    def refuse(index, subindex, **_):
        if index == 0x1A00:
            raise SdoAbortedError(0x06010002)
    with Bench('other mapping', 'sim8x8_16bit.yaml', source=lambda t: ROWS, sync_period=0.05) as bench:
        bench.supervise()
        bench.run()
        bench.take_whole(1)
        device = bench.simulator.devices[32]
        device._node.add_write_callback(refuse)
        # The mapping now has a taxel of the last row in place of the first taxel.
        device.lie(0x1A00, 1, (0x7130_3D10).to_bytes(4, 'little'))
        device._node.nmt.stop_heartbeat()  # The driver checks the node because the heartbeat stops.
        bench.take_until(lambda frame: np.isnan(frame.values).all())
        assert wait_until(lambda: cob_id(bench, 1) == 0x1A0)
        after = bench.take(20)
        health, = bench.driver.facts().pad('pad32').nodes
    assert all(np.isnan(frame.values).all() for _, frame in after) and health.frames_distrusted >= 20
