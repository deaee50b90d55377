"""The simulated skin as a device: the bytes that it sends, the requests that it refuses, and its slcan adapter."""

import os
import re
import select
import struct
import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import can
import numpy as np
import pytest
from can_bench import Bench, SkinMaster, serial_line
from faulty_bus import Adapter
from waiting import wait_until

from tactile_node.assembly.facts import LossReason
from tactile_node.bus import slcan_bus
from tactile_node.bus.open_bus import open_bus
from tactile_node.cia301.frame_bits import CanFrame
from tactile_node.cli.main import main
from tactile_node.cli.tare import DEFAULT_WAIT
from tactile_node.conditioning.tare import ContactGuard, measure, tare_limit
from tactile_node.errors import BusError, ConfigurationError, TareRefusedError
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.slcan_pty import SlcanPty, decode, encode
from tactile_node.simulator.touches import RAMP, TOUCH_HOLD, TOUCH_PAUSE, TouchProgram, gripper_sources
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.pads import make_pad, make_pads
from tactile_node.skin.taxel_codec import TaxelCodec

pytestmark = pytest.mark.bus

START, SYNC = (0x000, '0120'), (0x080, '')


class Wire(SkinMaster):
    """A CAN bus with one 16x16 pad at node 32, whose taxel (r, c) reads 16 r + c counts."""

    def __init__(self):
        super().__init__('wire', 'sim16x16.yaml', lambda t: 392.156862745 * np.arange(256).reshape(16, 16))

    def enable(self, number, flags='00'):
        cob_id = 0x1A0 + number - 1
        assert self.sdo(f'230{number - 1}1801{struct.pack("<H", cob_id).hex()}00{flags}').startswith('60')

    def take(self, count):
        return [(m.arbitration_id, m.data.hex().upper()) for m in (self.bus.recv(60) for _ in range(count))]

    def silent(self):
        return self.bus.recv(0.1) is None


@pytest.fixture
def wire():
    with Wire() as wire:
        yield wire


def test_boots_and_keeps_silent_until_configured(wire):
    assert wire.take(1) == [(0x720, '00')]
    wire.send(*START)
    wire.send(*SYNC)
    assert wire.silent()


def test_enabled_tpdos_follow_sync_only_while_operational(wire):
    wire.take(1)
    wire.enable(1)
    wire.enable(2)
    wire.send(*SYNC)
    assert wire.silent()  # The device is pre-operational.
    wire.send(*START)
    wire.send(*SYNC)
    assert wire.take(2) == [(0x1A0, '0001020304050607'), (0x1A1, '08090A0B0C0D0E0F')]
    wire.send(0x000, '0200')  # NMT command that stops all nodes.
    wire.send(*SYNC)
    assert wire.silent()


#: Some TPDOs of sim16x16.eds, listed in the order in which the device sends them.
UNSORTED = 'rows: 8\ncols: 7\npitch: 0.004\nvalue: {unit: Pa, scale: 1.0, bits: 8}\ntpdos:\n' + ''.join(
    f'- {{number: {number}, cob_id: $NODEID+0x{0x180 + number:X}, rows: {{first: 3, count: 2, step: [1, 0]}},\n'
    f'   map: {{object: 0x{0x2100 + number:X}, sub: 1, bits: 8, count: 8}},\n'
    f'   taxels: {{first: [{2 * place}, 0], step: [0, 1], count: 7, start_bit: 8, bit_step: 8}}}}\n'
    for place, number in enumerate((3, 1, 4, 2)))


def test_the_tpdos_are_sent_in_the_order_of_the_layout(tmp_path):
    """The frames of multiplexed TPDOs are also sent in the order of the layout.

    A layout that lists TPDOs in the device's order of sending must work with every part of the system.
    """
    path = tmp_path / 'unsorted.yaml'
    path.write_text(UNSORTED)
    still = np.repeat(np.arange(8.0)[:, None], 7, axis=1)
    with Bench('unsorted', str(path), eds='sim16x16.eds', source=lambda t: still, sync_period=0.05) as bench:
        bench.run()
        (_, frame), *_ = bench.take_whole(3)
        losses = bench.driver.facts().pad('pad32').losses
        assert np.array_equal(frame.values, still) and not losses[LossReason.OUT_OF_ORDER]
        assert bench.driver.facts().pad('pad32').orders == (None,)


def test_the_skin_applies_a_written_mapping_transmission_type_and_cob_id(wire):
    """TPDO 1 maps 0x210F sub 16 and 0x2101 sub 1, which have the counts 255 and 16.

    The device sends TPDO 1 with the COB-ID 0x3AA at every second SYNC.
    """
    wire.take(1)
    for request in ('2F001A0000000000', '23001A0108100F21', '23001A0208010121', '2F001A0002000000',
                    '2F00180202000000',
                    '23001801AA030000'):
        assert wire.sdo(request).startswith('60')
    wire.send(*START)
    wire.send(*SYNC)
    wire.send(*SYNC)
    assert wire.take(1) == [(0x3AA, 'FF10')] and wire.silent()


def test_sdo_reads_the_taxels(wire):
    wire.take(1)
    wire.enable(1)
    wire.send(*START)
    wire.send(*SYNC)
    wire.take(1)
    # Object 0x2103 sub 4 is the taxel in row 3, column 3, which reads 0x33.
    assert wire.sdo('4003210400000000') == '4F03210433000000'


@pytest.mark.parametrize(('requests', 'answer'), [
    (['4000300000000000'], '8000300000000206'),  # This object does not exist.
    (['4000180900000000'], '8000180911000906'),  # This sub-index does not exist.
    (['2301100000000000'], '8001100002000106'),  # The error register is read-only.
    (['2B00180202000000'], '8000180210000706'),  # The value has two bytes instead of one.
    (['23001A0108010121'], '80001A0122000008'),  # The write of 0 that unlocks the mapping is missing.
    (['2F001A0000000000', '23001A0108000030'], '80001A0141000406'),  # The mapped object does not exist.
    (['23001801A0010000', '2F001A0000000000'], '80001A0022000008'),  # The TPDO is enabled, so its mapping is locked.
    (['23001801A0010000', '23001801AA010000'], '8000180122000008')])  # The TPDO is enabled, so its COB-ID is locked.
def test_refusals_of_a_strict_device(wire, requests, answer):
    wire.take(1)
    assert [wire.sdo(request) for request in requests][-1] == answer


def test_reset_forgets_the_configuration_and_boots(wire):
    wire.take(1)
    wire.enable(1)
    wire.send(*START)
    wire.send(0x000, '8120')
    assert wire.take(1) == [(0x720, '00')]
    assert wire.sdo('4000180100000000') == '43001801A0010080'  # The request disables the TPDO again.


def test_heartbeat_is_sent_when_configured(wire):
    wire.take(1)
    assert wire.silent()
    assert wire.sdo('2B1710000A000000').startswith('60')  # Request for a heartbeat every 10 ms.
    assert wire.take(1) == [(0x720, '7F')]
    wire.send(*START)
    assert wait_until(lambda: wire.take(1) == [(0x720, '05')])


def test_a_bus_that_fails_under_the_skin_is_reported():
    adapter, failures = Adapter(), []
    skin = SkinSimulator([make_pad('pad', 32, 'sim16x16.yaml')], {'pad': lambda t: np.zeros((16, 16))}, failures.append)
    skin.start_on(adapter.open('virtual', 'failing', 1_000_000))
    try:
        adapter.is_plugged = False
        assert wait_until(lambda: failures) and isinstance(failures[0], can.CanOperationError)
    finally:
        skin.stop()


def test_touches_press_and_let_go():
    layout = load_layout('sim16x16.yaml')
    program = TouchProgram(layout, ('circle',), areas=(50,), seed=3, hold=1.0, pause=0.5)
    assert [touch.contact.shape for touch in program.touches] == ['circle'] and program.duration == 2.0
    assert program(0.2).max() == program(1.7).max() == 0
    full, (touch,) = program(1.0), program.touches
    assert (touch.load(0.2), touch.load(1.0)) == (0, 1) and touch.is_steady(1.0) and not touch.is_steady(0.55)
    assert (program(3.0) == full).all()  # The touches repeat.
    assert abs(full.sum() / full.max() - 50) < 1.5  # A pressure of 60 000 Pa acts on the area of 50 taxels.
    assert full.max() == pytest.approx(60_000, rel=1e-3)
    assert program(0.55).max() == pytest.approx(30_000, rel=1e-3)  # This time lies in the middle of the ramp of 0.1 s.
    on_off = TouchProgram(load_layout('nus_sinapse_64x64.yaml'), ('square',), areas=(400,), seed=3)(1.0)
    assert set(np.unique(on_off)) == {0, 1} and abs(on_off.sum() - 400) < 25


@pytest.mark.parametrize(('rows', 'cols'), [(8, 8), (12, 10)])
def test_the_default_touches_lie_within_a_small_pad(rows, cols):
    layout = replace(load_layout('sim16x16.yaml'), rows=rows, cols=cols)
    program = TouchProgram(layout, rounds=3)
    assert len(program.touches) == 3 * 3 * 5
    for touch in program.touches:
        pressed = program(touch.end - 0.2)
        assert abs(pressed.sum() / pressed.max() - touch.contact.area) < 0.1 * touch.contact.area


CONFIG = Path(__file__).parents[1] / 'config'
GRIPPER = [make_pad('left', 32, 'sim16x16.yaml'), make_pad('right', 64, 'sim16x16.yaml')]
FULL_SCALE = 100e3  # Full scale of sim16x16 [Pa].
TIMES = np.arange(0, 8, 0.02)  # Times in seconds.


def test_taxels_have_noise_that_the_seed_repeats():
    def noise(seed):
        noisy = gripper_sources(GRIPPER, seed=seed)
        still = TouchProgram(GRIPPER[0].layout, seed=seed, hold=TOUCH_HOLD, pause=TOUCH_PAUSE)
        return {pad: np.array([noisy[pad](t) - still(t)[:, ::step] for t in TIMES])
                for pad, step in (('left', 1), ('right', -1))}
    first, again, other = noise(3), noise(3), noise(4)
    for pad in ('left', 'right'):
        assert first[pad].std() == pytest.approx(0.005 * FULL_SCALE, rel=0.02)
        assert (first[pad] == again[pad]).all() and not (first[pad] == other[pad]).any()
    assert abs(np.corrcoef(first['left'].ravel(), first['right'].ravel())[0, 1]) < 0.02
    assert all((values < 0).mean() < 0.005 for values in first.values())  # Values of this skin are never below 0.
    on_off = gripper_sources([make_pad('pad', 32, 'nus_sinapse_64x64.yaml')])['pad']
    assert on_off(1.0).dtype == bool


#: Duration of a tare of 50 frames at 50 Hz [s].
TARE_TIME = 1.0
#: Layouts of all pads with values in pascal or newton, and their node-IDs.
LAYOUTS = [(path.name, [32, 35] if path.stem.startswith('nodes2') else [32]) for path in sorted(CONFIG.glob('*.yaml'))
           if path.with_suffix('.eds').exists() and load_layout(path.name).value.unit != '1']


@pytest.mark.parametrize(('layout', 'nodes'), LAYOUTS)
def test_a_tare_that_is_tried_again_passes_between_two_touches_and_never_during_one(layout, nodes):
    pad, = make_pads([layout], nodes)
    codec, unit, period = TaxelCodec(pad.layout), pad.layout.value.unit, pad.layout.frame_period(0.02)
    source, fresh = gripper_sources([pad], ('square',))[pad.name], np.ones(len(pad.layout.carriers), bool)
    program = TouchProgram(pad.layout, ('square',), hold=TOUCH_HOLD, pause=TOUCH_PAUSE)
    times = np.arange(0, 5 * TOUCH_HOLD, period)
    frames = np.array([codec.decode(codec.encode(source(time)), fresh)[0] for time in times])
    is_pressed = np.array([program(time).any() for time in times])
    count = round(TARE_TIME / period)

    def passes(first):
        try:
            measure(frames[first:first + count], tare_limit(0.0, unit), ContactGuard.of_unit(unit))
        except TareRefusedError:
            return False
        # Near its beginning and end, a touch presses with less than the limit.
        assert is_pressed[first:first + count].sum() * period <= 2 * RAMP
        return True
    for begin in range(count):  # The attempts follow one another without a gap.
        assert any(passes(first) for first in range(begin, begin + round(DEFAULT_WAIT / period), count)), times[begin]


@pytest.mark.parametrize('words', [('--hold', '0'), ('--hold', 'inf'), ('--areas', '0')])
def test_a_skin_that_cannot_be_simulated_is_refused(words, capsys):
    assert main(['simulate', '--interface', 'virtual', '--duration', '0', *words]) == 2
    assert words[0] in capsys.readouterr().err


@pytest.mark.parametrize(('line', 'can_id', 'data', 'extended', 'remote'), [
    ('t1A02AA0B', 0x1A0, 'AA0B', False, False), ('t0800', 0x080, '', False, False),
    ('T0000012381122334455667788', 0x123, '1122334455667788', True, False), ('r1800', 0x180, '', False, True),
    ('R1FFFFFFF3', 0x1FFFFFFF, '', True, True)])
def test_slcan_lines(line, can_id, data, extended, remote):
    message = decode(line.encode())
    assert (message.arbitration_id, message.data.hex().upper()) == (can_id, data)
    assert (message.is_extended_id, message.is_remote_frame) == (extended, remote)
    assert encode(message) == line.encode() + b'\r'


@pytest.mark.parametrize('line', ['t', 't1A0', 't1A09AA', 't1A02AA', 'tXYZ0', 't1A02AABBCC', 'T1A00',
                                  't1A01GG'])
def test_text_that_is_not_an_slcan_line(line):
    assert decode(line.encode()) is None


def read_until(descriptor, pattern):
    """Return the bytes from a terminal once they match ``pattern`` completely, or once 60 s have passed without data.

    The terminal may deliver the bytes in pieces.
    """
    read = b''
    while not re.fullmatch(pattern, read, re.DOTALL) and select.select([descriptor], [], [], 60)[0]:
        read += os.read(descriptor, 1 << 16)
    return read


def test_slcan_adapter_answers_as_the_protocol_says():
    with SlcanPty() as adapter:
        port = os.open(adapter.port, os.O_RDWR | os.O_NOCTTY)

        def ask(line):
            os.write(port, line)
            message, end = adapter.recv(0.02), time.monotonic() + 60
            while not select.select([port], [], [], 0)[0] and time.monotonic() < end:
                message = adapter.recv(0.02) or message
            return read_until(port, rb'.*[\r\a]'), message

        assert ask(b'V\r')[0] == b'V1013\r' and ask(b'S8\r')[0] == b'\r' and ask(b'?\r')[0] == b'\a'
        # The first command is too long, and the second command comes before the channel is open.
        assert ask(b't08000\r')[0] == ask(b't0800\r')[0] == b'\a'
        assert ask(b'O\r')[0] == b'\r'
        answer, message = ask(b't12320A0B\r')
        assert answer == b'z\r' and (message.arbitration_id, bytes(message.data)) == (0x123, b'\x0A\x0B')
        adapter.send(can.Message(arbitration_id=0x1A0, is_extended_id=False, data=[1]))
        assert read_until(port, rb'.*\r') == b't1A0101\r'
        os.close(port)


def test_a_second_simulator_leaves_the_link_of_the_first_alone(tmp_path):
    link = tmp_path / 'skin'
    with SlcanPty(str(link)) as first:
        with pytest.raises(ConfigurationError, match=first.port):
            SlcanPty(str(link))
        assert os.readlink(link) == first.port
    assert not link.is_symlink()
    link.symlink_to(tmp_path / 'gone')  # the rest of a simulator that was killed
    with SlcanPty(str(link)) as later:
        assert os.readlink(link) == later.port
        link.unlink()
        link.symlink_to(tmp_path)  # the user has given the name to something else
    assert link.is_symlink()


def test_client_that_does_not_read_costs_frames_not_memory():
    with SlcanPty() as adapter:
        port = os.open(adapter.port, os.O_RDWR | os.O_NOCTTY)
        os.write(port, b'O\rt0010\r')
        assert adapter.recv(60)  # A received message shows that the channel is open.
        message = can.Message(arbitration_id=0x1A0, is_extended_id=False, data=bytes(8))
        for _ in range(20_000):
            adapter.send(message)
        assert adapter.lost > 10_000
        before = adapter.lost
        adapter.send_all([CanFrame(0x1A0, bytes(8))] * 500)
        assert adapter.lost - before == 500
        os.write(port, b'C\rO\rt0010\r')  # The next client finds no bytes left over from the previous client.
        assert adapter.recv(60)
        adapter.send(can.Message(arbitration_id=0x123, is_extended_id=False))
        assert read_until(port, rb'.*t1230\r') == b'\r\rz\rt1230\r'
        os.close(port)


def test_slcan_client_reads_through_noise_on_the_line():
    with serial_line() as (adapter, port):
        client = open_bus('slcan', port, 500_000, sleep_after_open=0.0)
        # python-can writes these bytes. From version 4.5 on, it writes an empty line after the bit rate.
        opening = rb'C\rS6\r\r?O\rO\r'
        assert re.fullmatch(opening, read_until(adapter, opening))
        os.write(adapter, b'\r\at1A02AABB\rz\rt1A0\rtXYZ0\r\xff\xfe\rV1013\rt1A01')
        os.write(adapter, b'CC\r')
        received = [client.recv(60) for _ in range(5)]
        came = [(m.is_error_frame, bytes(m.data)) for m in received]
        damaged = (True, bytes(8))
        # The three damaged lines are t1A0, tXYZ0 and \xff\xfe.
        assert came == [(False, b'\xAA\xBB'), damaged, damaged, damaged, (False, b'\xCC')]
        assert client.recv(0.1) is None
        client.shutdown()


def test_slcan_lines_may_end_with_cr_lf():
    with serial_line() as (adapter, port):
        client = open_bus('slcan', port, 500_000, sleep_after_open=0.0)
        os.write(adapter, b'\r\nz\r\nt1A02AABB\r\nV1013\r\nt1A01CC\r')
        os.write(adapter, b'\nt1A00\r\n')
        came = [(m.is_error_frame, bytes(m.data)) for m in (client.recv(60) for _ in range(3))]
        assert came == [(False, b'\xAA\xBB'), (False, b'\xCC'), (False, b'')]
        assert client.recv(0.1) is None
        client.shutdown()


def test_an_slcan_port_is_for_one_process_and_can_be_opened_again():
    with SlcanPty() as adapter, ExitStack() as cleanup:
        cleanup.callback(can.Notifier(adapter, [], 0.01).stop)
        client = open_bus('slcan', adapter.port, 500_000)
        with pytest.raises(BusError, match='another process has this port open') as refused:
            open_bus('slcan', adapter.port, 500_000)
        assert 'tactile bringup --record' in refused.value.remedy
        client.shutdown()
        open_bus('slcan', adapter.port, 500_000).shutdown()


def test_an_slcan_adapter_that_does_not_answer_is_opened_again_when_it_has_had_time_to_start(monkeypatch):
    slept = []
    clock = SimpleNamespace(sleep=slept.append, monotonic=time.monotonic, time=time.time)
    monkeypatch.setattr(slcan_bus, 'time', clock)
    with serial_line() as (adapter, port):
        client = open_bus('slcan', port, 500_000)
        assert sum(slept) == pytest.approx(slcan_bus.RESET_TIME - slcan_bus.WAKE_TIMEOUT)
        twice = rb'C\r.*S6\r.*O\r.*V\r.*S6\r.*O\r'
        assert re.fullmatch(twice, read_until(adapter, twice), re.DOTALL)
        client.shutdown()
