"""The bus load that pads cause. A user who plans too many pads must be warned before any frame is lost.

The bit counts in this module follow ISO 11898-1. In a standard data frame of n bytes, 34 + 8 n bits are subject to bit
stuffing: start bit, identifier, RTR, IDE, r0, DLC, data and CRC. At most one stuff bit follows the first five bits, and
at most one follows every four bits after them. Another 13 bits are not subject to bit stuffing. For n = 8, a frame has
98 + 24 + 13 bits.
"""

import logging
from dataclasses import replace

import pytest

from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.load import planned_load
from tactile_node.bus.open_bus import open_bus
from tactile_node.errors import ConfigurationError
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.pads import make_pad
from tactile_node.sources.supervisor import Supervisor

FRAME, SYNC = 98 + 24 + 13, 34 + 8 + 13
NODE_IDS = 32, 40, 48, 56


@pytest.mark.parametrize('pads, rate', [(1, 50), (4, 50), (2, 100), (3, 100)])
def test_each_pad_takes_its_frames_and_all_share_one_sync(pads, rate):
    layouts = [load_layout('sim16x16.yaml')] * pads
    assert planned_load(layouts, 1_000_000, 1 / rate) == pytest.approx(rate * (SYNC + pads * 32 * FRAME) / 1e6)
    assert planned_load(layouts, 500_000, 1 / rate) == pytest.approx(2 * rate * (SYNC + pads * 32 * FRAME) / 1e6)


def test_a_pad_without_sync_sends_at_its_own_time_beside_one_with_sync():
    """The layout event8x8_16bit.yaml sends 16 frames of 8 bytes every 50 ms."""
    layouts = [load_layout('sim16x16.yaml'), load_layout('event8x8_16bit.yaml')]
    assert planned_load(layouts, 1_000_000, 0.01) == pytest.approx((100 * (SYNC + 32 * FRAME) + 20 * 16 * FRAME) / 1e6)
    assert planned_load(layouts[1:], 1_000_000, 0.01) == pytest.approx(20 * 16 * FRAME / 1e6)


@pytest.mark.parametrize('allow', [False, True], ids=['checked', 'full bus allowed'])
def test_a_bit_rate_that_no_device_has_is_named_before_the_load_that_follows_from_it(allow):
    settings = BusSettings('virtual', 'nowhere', bitrate=123_456, allow_full_bus=allow)
    with pytest.raises(ConfigurationError) as refused:
        Supervisor(settings, placed_pads(1), lambda pad, frame: None)
    assert refused.value.where == 'bitrate' and refused.value.got == '123456'
    assert '125000' in refused.value.expected and 'sync_period' not in str(refused.value)


@pytest.mark.parametrize('interface', ['virtual', 'slcan', 'socketcan'])
def test_every_interface_refuses_a_bit_rate_that_no_device_has(interface):
    with pytest.raises(ConfigurationError, match='^bitrate'):
        open_bus(interface, '/nowhere', 123_456)


def placed_pads(count):
    return tuple(make_pad(f'pad{node_id}', node_id, 'sim16x16.yaml') for node_id in NODE_IDS[:count])


@pytest.mark.slow
@pytest.mark.parametrize(('pads', 'longest'), [(1, 0.0047), (2, 0.0092), (4, 0.0183)])
def test_a_bus_that_would_be_too_full_is_refused_with_the_rate_that_fits(pads, longest):
    load = (SYNC + pads * 32 * FRAME) / 1e6
    assert load / longest <= 0.95 < load / (longest - 0.0001)
    settings = BusSettings('virtual', 'too_full', sync_period=longest - 0.0001)
    with pytest.raises(ConfigurationError) as refused:
        Supervisor(settings, placed_pads(pads), lambda name, frame: None)
    assert f'{longest:g} s' in refused.value.remedy
    for fits in (replace(settings, sync_period=longest), replace(settings, allow_full_bus=True)):
        Supervisor(fits, placed_pads(pads), lambda name, frame: None)


@pytest.mark.slow
@pytest.mark.parametrize('pads, rate, load', [(1, 50, None), (4, 50, None), (3, 100, 1.3015), (4, 100, 1.7335)])
def test_the_driver_starts_and_warns_of_pads_that_its_bus_cannot_carry(pads, rate, load, caplog):
    """A user who reads only the log must be warned before the first frame is missing.

    Warnings after the first one appear only in the status.
    """
    settings = BusSettings('virtual', f'planned{pads}at{rate}', sync_period=1 / rate, allow_full_bus=True)
    placed = placed_pads(pads)
    bus = Supervisor(settings, placed, lambda name, frame: None)
    with caplog.at_level(logging.WARNING):
        bus.open()
        bus.close()
    facts = [record.fact for record in caplog.records if hasattr(record, 'fact')]
    assert facts == ([] if load is None else [pytest.approx(load)])
