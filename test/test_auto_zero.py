"""The device's own auto-zero where it is not to be had; where it is: test_driver_recovery.py."""

import pytest
from can_bench import Bench
from fault_bench import FaultBench

from tactile_node.bus import auto_zero, bus_devices
from tactile_node.errors import DeviceError, HalfZeroedError
from tactile_node.recording.log_source import LogSource
from tactile_node.skin.pads import make_pad

pytestmark = pytest.mark.bus


def test_an_eds_without_it_is_reported():
    with Bench('no_zero', 'sim16x16.yaml') as bench:
        bench.driver.open()
        with pytest.raises(DeviceError, match='0x6125.*no such object.*without on_device'):
            bench.driver.auto_zero('pad32')


def test_a_device_that_refuses_is_reported_by_channel(monkeypatch):
    monkeypatch.setattr(auto_zero, 'ZERO_SIGNATURE', b'nero')
    with Bench('refuses_zero', 'sim8x8_16bit.yaml') as bench:
        bench.driver.open()
        with pytest.raises(DeviceError, match='0x6125 sub 1: .*0 of 64 channels are zeroed') as refused:
            bench.driver.auto_zero('pad32')
        assert not isinstance(refused.value, HalfZeroedError)


@pytest.mark.parametrize('answer', [bytes.fromhex('8025610322000008'), None])
def test_a_device_that_is_zeroed_in_part_or_does_not_answer_is_distinguished(answer):
    """The third channel is refused (SDO abort), or its confirmation lost: then its state is not known."""
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


def test_of_a_pads_nodes_the_first_may_be_zeroed_when_the_second_refuses(monkeypatch):
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
            bench.driver.auto_zero('pad32')


def test_a_log_has_no_device(tmp_path):
    source = LogSource(str(tmp_path / 'x.log'), (make_pad('pad', 32, 'sim8x8_16bit.yaml'),), lambda *_: None)
    with pytest.raises(DeviceError, match='x.log'):
        source.auto_zero('pad')
