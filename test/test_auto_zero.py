"""The device's own auto-zero where it is not to be had; where it is: test_driver_recovery.py."""

import pytest
from can_bench import Bench

from tactile_node.canbus import auto_zero
from tactile_node.canbus.log_source import LogSource
from tactile_node.canbus.pads import make_pad
from tactile_node.errors import DeviceError


def test_an_eds_without_it_is_told():
    with Bench('no_zero', 'sim16x16.yaml') as bench:
        bench.driver.open()
        with pytest.raises(DeviceError, match='0x6125.*no such object.*without on_device'):
            bench.driver.auto_zero('pad32')


def test_a_device_that_refuses_is_told_by_channel(monkeypatch):
    monkeypatch.setattr(auto_zero, 'ZERO', b'nero')
    with Bench('refuses_zero', 'sim8x8_16bit.yaml') as bench:
        bench.driver.open()
        with pytest.raises(DeviceError, match='0x6125 sub 1: .*0 of 64 channels are zeroed'):
            bench.driver.auto_zero('pad32')


def test_a_log_has_no_device(tmp_path):
    source = LogSource(str(tmp_path / 'x.log'), (make_pad('pad', 32, 'sim8x8_16bit.yaml'),), lambda *_: None)
    with pytest.raises(DeviceError, match='x.log'):
        source.auto_zero('pad')
