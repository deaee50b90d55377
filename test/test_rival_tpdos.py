"""A device set up for another layout: its other TPDOs may send under COB-IDs that now are ours."""

import logging

import numpy as np
import pytest
from can_bench import Bench
from canopen import SdoAbortedError

from tactile_node.bus.skin_bus import SkinBus
from tactile_node.errors import DeviceError
from tactile_node.package_files import config_path
from tactile_node.skin.pads import make_pad

pytestmark = pytest.mark.bus

#: the simulated skin's TPDO 3 (first half of row 1) alone, under the COB-ID that its TPDO 1 (of row 0) has
ONE = '''
rows: 1
cols: 4
pitch: 0.004
value: {unit: N, scale: 0.0005, offset: 30000, bits: 16, signed: true, pressure: falling}
tpdos:
- {number: 3, cob_id: $NODEID+0x180, map: {object: 0x7130, sub: 9, bits: 16, count: 4},
   taxels: {first: [0, 0], step: [0, 1], count: 4, bit_step: 16}}
'''
ROWS = np.repeat(np.arange(8.0)[:, None] + 1, 8, axis=1)  # each taxel reads the number of its row, from 1


def one_tpdo(bench, folder):
    """A driver of ONE on the bench's bus."""
    path = folder / 'one.yaml'
    path.write_text(ONE)
    pad = make_pad('pad32', 32, str(path), str(config_path('sim8x8_16bit.eds')))
    return SkinBus(bench.settings, (pad,), lambda name, frame: bench.frames.put((name, frame)))


def cob_id(bench, number):
    """0x1800 + number - 1, sub 1, of the device."""
    return bench.simulator.devices[32]._number(0x1800 + number - 1, 1)


def test_no_other_tpdo_is_taken_for_taxels(tmp_path, caplog):
    """CANopenNode's demo device sent both under one COB-ID, and the first came out as valid values."""
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
        losses = bench.driver.statistics().pads['pad32'].losses
    assert all(np.allclose(frame.values, 2.0) for _, frame in frames)
    assert rival >> 31 == 1 and other >> 31 == 0, 'TPDO 2 has another COB-ID'
    assert not any(losses.values()) and 'TPDO 1' in caplog.text


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
