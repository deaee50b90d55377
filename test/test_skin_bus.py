"""The driver's bus is tested with the simulated skin: boot-up, configuration, streaming, and refused settings."""

import re
import time

import can
import numpy as np
import pytest
from can_bench import INTERFACE, Bench, other_bus
from test_logs import play
from waiting import wait_until

from tactile_node.assembly.health import BusFault
from tactile_node.bus.skin_bus import BusSettings, SkinBus
from tactile_node.cia301.objects import NmtCommand
from tactile_node.errors import BusError, ConfigurationError, DeviceAbsentError, DeviceError, LogError
from tactile_node.package_files import config_path
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.pads import PadSettings, make_pad
from tactile_node.taxel_frame import TaxelStatus

pytestmark = pytest.mark.bus


# CAN frames that the log must contain in this order, according to CiA 301.
@pytest.mark.parametrize(('layout', 'sent'), [
    ('sim16x16.yaml', [
        '000#8020',  # NMT: pre-operational.
        '620#4018100100000000',  # SDO upload of 0x1018 sub 1.
        '620#23001801A0010080',  # SDO download of 0x800001A0 to 0x1800 sub 1, which disables the TPDO.
        '620#23001801A0010000',  # SDO download of 0x000001A0 to 0x1800 sub 1.
        '000#0120', '080#',  # NMT start, followed by a SYNC.
        # The driver stops at the end.
        '000#8020']),
    # The TPDOs are row 0 with five taxels of 1023 counts, and the first byte of row 11.
    ('rows12x5_10bit.yaml', ['1A0#00FFFFFFFFFFFF03', '1A0#0B']),
    # Transmission type 254, followed by 0x2107 sub 4 of node 0x20.
    ('mpdo8x8_16bit.yaml', ['620#2F001802FE000000', '1A0#20072104']),
    # Transmission type 254, event timer 20 ms.
    ('event12x8_8bit.yaml', ['620#23001801A0010080', '620#2F001802FE000000', '620#2B00180514000000',
                             '620#23001801A0010000']),
    # Transmission type 255, event timer 10 ms.
    ('event8x8_16bit.yaml', ['620#23001801A0010080', '620#2F001802FF000000', '620#2B00180364000000',
                             '620#2B00180532000000', '620#23001801A0010000'])])  # 50 ms.
def test_every_kind_of_skin_end_to_end_and_its_log_again(tmp_path, layout, sent):
    skin, record = load_layout(layout), tmp_path / 'session.log'
    wanted = skin.value.scale * (np.arange(skin.rows * skin.cols).reshape(skin.rows, skin.cols) % 50)
    wanted[0] = 0
    with Bench(layout, layout, source=lambda t: wanted, sync_period=0.02, record=str(record)) as bench:
        bench.run()
        (_, first), = bench.take(1)
        live = [frame for _, frame in bench.take_whole(10)]
    for frame in live:
        np.testing.assert_allclose(frame.values, wanted, atol=1e-6 * skin.value.scale, rtol=1e-6)
        assert (frame.status == TaxelStatus.VALID).all()
        assert (frame.tpdo_ages is not None) == (layout == 'event8x8_16bit.yaml')
    assert first.sequence == 0 and (np.diff([frame.stamp for frame in live]) > 0).all()
    lines = [line.split() for line in record.read_text().splitlines()]
    assert {line[1] for line in lines} == {bench.channel}  # The log also contains the frames that our driver sent.
    assert any(line[2].startswith('080#') for line in lines) == skin.needs_sync
    rest = iter(lines)
    assert all(any(line[2].startswith(frame) for line in rest) for frame in sent)
    played, source = play(record, bench.pads)
    stamps = np.array([frame.stamp for _, frame in played])
    for frame in live:
        _, same = played[np.abs(stamps - frame.stamp).argmin()]
        assert abs(same.stamp - frame.stamp) < 2e-5  # candump writes microseconds.
        np.testing.assert_array_equal(same.values, frame.values)
    pad = source.facts().pad('pad32')
    assert pad.tpdos_received == pad.tpdos_used + pad.tpdos_pending + sum(pad.losses.values())
    assert pad.tpdos_used >= 10 * len(skin.tpdos)


def test_stop_and_start_again():
    with Bench('again', sync_period=0.01) as bench:
        bench.run()
        bench.take(3)
        bench.driver.stop()
        device = bench.simulator.devices[32]
        assert wait_until(lambda: not device.operational)
        # The last sweep may still be in transit, so the number of sent frames may still rise.
        assert wait_until(lambda: bench.driver.facts().pad('pad32').tpdos_received == device.frames_sent)
        bench.driver.start()
        assert bench.take_until(lambda frame: frame.sequence == 0)
        bench.driver.stop()
        bench.driver.close()
        bench.driver.close()
        bench.forget()
        bench.run()  # The restarted driver counts its frames from 0.
        assert bench.take(1)[0][1].sequence == 0


def test_a_start_whose_command_cannot_be_sent_leaves_the_bus_stopped(monkeypatch):
    """If the failed start counted as started, the next start would return at once, and nothing would send SYNC."""
    with Bench('refused', sync_period=0.01) as bench:
        bench.driver.open()
        bench.driver.configure()
        command = bench.driver.devices.command

        def refuse(which, node):
            if which is NmtCommand.START:
                raise BusError('the bus', expected='a command that is sent', got='a full buffer', remedy='Try again.')
            command(which, node)
        monkeypatch.setattr(bench.driver.devices, 'command', refuse)
        with pytest.raises(BusError, match='full buffer'):
            bench.driver.start()
        monkeypatch.undo()
        bench.driver.start()
        assert bench.take(3)


def test_every_call_is_allowed_in_every_state():
    with Bench('states') as bench:
        bench.driver.stop()
        bench.driver.close()
        for call in (bench.driver.configure, bench.driver.start):
            with pytest.raises(BusError, match='open'):
                call()
        bench.driver.open()
        bench.driver.open()


def test_absent_tpdo_is_missing_not_zero():
    """After the configuration, another master disables TPDO 3, which carries row 1, columns 0 to 7."""
    with Bench('absent', source=lambda t: np.full((16, 16), 3921.56862745), produce_sync=False) as bench, \
            other_bus('absent') as other:
        bench.run()
        while other.recv(0):
            pass
        other.send(can.Message(arbitration_id=0x620, is_extended_id=False,
                               data=bytes.fromhex('23021801A2010080')))
        # The device's response confirms the write to 0x1802 sub 1.
        assert wait_until(lambda: other.recv(60).data.hex() == '6002180100000000')
        other.send(can.Message(arbitration_id=0x80, is_extended_id=False))
        assert wait_until(lambda: bench.driver.facts().pad('pad32').tpdos_received == 31)
        other.send(can.Message(arbitration_id=0x80, is_extended_id=False))
        frame = bench.take(1)[0][1]
    assert frame.missing_can_frames == 1
    stale = np.zeros((16, 16), bool)
    stale[1, :8] = True
    assert (np.isnan(frame.values) == stale).all() and (frame.status[stale] == TaxelStatus.STALE).all()
    np.testing.assert_allclose(frame.values[~stale], 3921.56862745, rtol=1e-6)


def test_no_device_on_the_bus():
    with Bench('silent', boot_timeout=0.5) as bench:
        bench.simulator.stop()
        bench.driver.open()
        with pytest.raises(DeviceError, match='node 32.*no answer.*power, wiring'):
            bench.driver.configure()
        assert any(isinstance(fact, DeviceAbsentError) and 'node 32' in fact.where for fact in bench.log.facts)


def test_a_wrong_node_id_is_reported_with_the_nodes_that_are_heard():
    with Bench('wrong', nodes=(32, 64), boot_timeout=0.5) as bench:
        bench.simulator.stop()
        bench.driver.open()
        with other_bus('wrong') as other:
            for node_id in (64, 5):
                other.send(can.Message(arbitration_id=0x700 + node_id, data=[0x7F], is_extended_id=False))
            with pytest.raises(DeviceAbsentError) as absent:
                bench.driver.configure()
    assert absent.value.got == 'no answer, but heartbeats of node 5, 64' and '`tactile scan`' in absent.value.remedy


def test_second_pad_missing_names_its_node():
    with Bench('half', nodes=(32, 64), boot_timeout=2.0) as bench:
        bench.simulator.devices[64].power_off()
        bench.driver.open()
        with pytest.raises(DeviceError, match="node 64 .pad 'pad64'"):
            bench.driver.configure()
        bench.simulator.devices[64].boot()
        bench.driver.configure()


@pytest.mark.parametrize(('sub', 'value', 'says'), [
    (1, 0x99, 'vendor 0x99'), (2, 0x1, 'product 0x1'), (3, 0x0002_0000, 'revision 0x20000')])
def test_wrong_identity_is_refused(sub, value, says):
    with Bench(f'identity{sub}') as bench:
        pad = bench.simulator.devices[32]
        pad.lie(0x1018, sub, value.to_bytes(4, 'little'))
        bench.driver.open()
        with pytest.raises(DeviceError, match='0x1018') as refused:
            bench.driver.configure()
        assert says in str(refused.value)


@pytest.mark.parametrize(('interface', 'channel', 'says'), [
    ('socketcan', 'nocan7', 'ip link set nocan7 up|modprobe'), ('slcan', '/dev/nothing', '/dev/nothing')])
def test_bus_that_cannot_be_opened(interface, channel, says):
    pads = Bench('unused').pads
    with pytest.raises(BusError) as refused:
        SkinBus(BusSettings(interface, channel), tuple(pads), lambda *_: None).open()
    assert re.search(says, str(refused.value)) and f'{interface} {channel}' in str(refused.value)


def test_an_identity_that_the_eds_does_not_give_is_reported(tmp_path, caplog):
    eds = config_path('sim8x8_16bit.eds').read_text()
    (tmp_path / 'x.eds').write_text(re.sub(r'(\[1018sub[123]\][^[]*)DefaultValue=[^\n]*\n', r'\1', eds))
    pads = (make_pad('pad32', 32, 'sim8x8_16bit.yaml', str(tmp_path / 'x.eds')),)
    with Bench('no_identity', 'sim8x8_16bit.yaml') as bench:
        bench.driver = SkinBus(bench.settings, pads, lambda *_: None)
        bench.driver.open()
        bench.driver.configure()
    assert 'gives no vendor, product, revision in object 0x1018' in caplog.text


def test_live_pad_needs_its_eds():
    pad = Bench('unused').pads[0]
    with pytest.raises(ConfigurationError, match='make_pad'):
        SkinBus(BusSettings('virtual', 'x'), (PadSettings('pad', (32,), pad.layout),), lambda *_: None)


def test_record_that_cannot_be_written_leaves_the_bus_closed(tmp_path):
    driver = SkinBus(BusSettings('virtual', 'norecord', record=str(tmp_path / 'x.pdf')),
                     tuple(Bench('u').pads),
                     lambda *_: None)
    with pytest.raises(LogError):
        driver.open()
    driver.close()


def test_consumer_that_fails_does_not_stop_the_bus(caplog):
    with Bench('failing', sync_period=0.01) as bench:
        bench.driver = SkinBus(BusSettings(INTERFACE, bench.channel, sync_period=0.01), bench.pads,
                               lambda *_: 1 / 0)
        bench.run()
        assert wait_until(lambda: bench.driver.facts().consumer_errors >= 3)


def test_a_sync_producer_that_dies_is_an_internal_error_with_its_traceback(monkeypatch, caplog):
    with Bench('dying', sync_period=0.01) as bench:
        bench.run()
        bench.take(1)
        monkeypatch.setattr(bench.driver.sync.pause, 'is_due', lambda is_in_doubt: 1 / 0)
        assert wait_until(lambda: bench.driver.failure)
        assert bench.driver.failure.fault is BusFault.INTERNAL_ERROR
    assert 'Traceback' in caplog.text and 'ZeroDivisionError' in caplog.text


@pytest.mark.parametrize('interface', ['virtual', 'slcan'])
@pytest.mark.parametrize('step', [-0.5, 0.5])
def test_stamps_of_what_is_received_keep_up_with_a_wall_clock_that_is_set(monkeypatch, interface, step):
    """For slcan, the stamps also come from this machine's clock.

    In an earlier version, TPDOs counted as 0.5 s old for more than an hour after the clock was set back by 0.5 s.
    """
    driver = SkinBus(BusSettings(interface, 'can0'), (make_pad('pad', 32, 'sim16x16.yaml'),), print)
    clock, wall = driver.queue.clock, time.time
    assert abs(clock.of(wall()) - clock.now()) < 0.05
    monkeypatch.setattr(time, 'time', lambda: wall() + step)
    for _ in range(3):
        assert abs(clock.of(time.time()) - clock.now()) < 0.05


def test_sync_of_another_producer_gives_no_frames_while_inactive():
    with Bench('inactive', produce_sync=False) as bench, other_bus('inactive') as other:
        def sync(count):
            for _ in range(count):
                other.send(can.Message(arbitration_id=0x80, is_extended_id=False))
        bench.driver.open()
        bench.driver.configure()
        sync(3)
        assert wait_until(lambda: bench.driver.facts().can_frames.get('sync') == 3)
        bench.driver.start()
        sync(2)
        assert bench.take(1)[0][1].sequence == 0
        bench.driver.stop()
        sync(3)
        assert wait_until(lambda: bench.driver.facts().can_frames.get('sync') == 8)
        bench.driver.close()
        assert bench.driver.facts().pad('pad32').published <= 2 and bench.frames.qsize() <= 1
