"""Tests that `tactile scan --bitrate auto` listens at each bit rate and sends nothing on a bus in use."""

import json
import threading
import time
from contextlib import contextmanager

import can
import pytest

from tactile_node.bus.node_scan import find_bit_rate
from tactile_node.cli.main import main
from tactile_node.simulator.slcan_pty import SlcanPty

pytestmark = pytest.mark.bus

HEARTBEAT = can.Message(arbitration_id=0x705, is_extended_id=False, data=[5])


BIT_RATES = {b'S4': 125_000, b'S5': 250_000, b'S6': 500_000, b'S7': 800_000, b'S8': 1_000_000}


class Adapter(SlcanPty):
    """Adapter on a bus with one bit rate. It records every command.

    A client that sets another bit rate receives only ``noise``, and its frames are not received.
    """

    def __init__(self, bitrate, noise=b''):
        super().__init__()
        self._bitrate, self._noise = bitrate, noise
        self._set_rate = None
        self.commands, self.received = [], []

    def _answer(self, line):
        self.commands.append(line)
        if line[:1] == b'S':
            self._set_rate = BIT_RATES.get(line)
        answer = super()._answer(line)
        if self._set_rate != self._bitrate:
            self._received.clear()
        return answer

    def send(self, msg, timeout=None):
        if self._set_rate == self._bitrate:
            super().send(msg, timeout)
        elif self._noise and self._open:
            self._write(self._noise)


@contextmanager
def bus_of(adapter, sends=True):
    """Run the adapter together with node 5, which sends a heartbeat every 20 ms."""
    ends = threading.Event()

    def serve():
        due = 0.0
        while not ends.is_set():
            message = adapter.recv(0.005)
            if message is not None:
                adapter.received.append(message)
            if sends and time.monotonic() >= due:
                adapter.send(HEARTBEAT)
                due = time.monotonic() + 0.02
    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield adapter
    finally:
        ends.set()
        thread.join(60)
        adapter.shutdown()


def scan(capsys, adapter, *words):
    code = main(['scan', '--interface', 'slcan', '--channel', adapter.port, '--bitrate', 'auto', '--listen', '0.2',
                 *words])
    out = capsys.readouterr()
    return code, out.out, out.err


@pytest.mark.parametrize(('bitrate', 'noise'), [(800_000, b''), (500_000, b't7051AB0\r'), (1_000_000, b'')])
def test_the_bit_rate_is_the_one_at_which_frames_are_sound(bitrate, noise):
    """At a wrong bit rate, the adapter delivers either nothing or bytes that do not form a frame."""
    with bus_of(Adapter(bitrate, noise)) as adapter:
        assert find_bit_rate('slcan', adapter.port, 0.2) == bitrate


def test_the_scan_continues_at_the_detected_bit_rate(capsys):
    with bus_of(Adapter(500_000)) as adapter:
        code, out, _ = scan(capsys, adapter, '--passive', '--json')
        assert not adapter.received  # With --passive, the scan sends nothing even after it has found the bit rate.
    node = json.loads(out)
    assert code == 0 and node['bitrate'] == 500_000 and node['node_id'] == 5


def test_nothing_is_sent_at_a_wrong_bit_rate(capsys):
    """A controller that is active at a wrong bit rate destroys every frame with error flags."""
    with bus_of(Adapter(125_000)) as adapter:
        code, out, _ = scan(capsys, adapter, '--node-id', '9')
        commands = list(adapter.commands)
    assert code == 0 and 'bit rate: 125000 bit/s' in out and 'node 5' in out
    last = max(i for i, command in enumerate(commands) if command == b'L')
    before = commands[:last + 1]
    assert b'O' not in before and not [command for command in before if command and command[:1] in b'tTrR']
    assert [rate for rate in (b'S8', b'S6', b'S5', b'S4') if rate in before] == [b'S8', b'S6', b'S5', b'S4']
    assert b'S7' not in before and commands[last:].count(b'O') >= 1


@pytest.mark.parametrize(('adapter', 'sends', 'part'), [
    (lambda: Adapter(500_000), False, 'no frames'),
    (lambda: Adapter(83_000, b't7051AB0\r'), True, '1000 kbit/s: 0 (1 error frames)')])
def test_a_bus_without_a_right_bit_rate_is_reported(adapter, sends, part, capsys):
    with bus_of(adapter(), sends) as adapter:
        code, out, err = scan(capsys, adapter)
        assert code == 2 and not out and part in err and 'two other nodes' in err
        assert b'O' not in adapter.commands and not adapter.received


@pytest.mark.parametrize('words', [
    ('--interface', 'socketcan', '--channel', 'can0', '--bitrate', 'auto'),
    ('--interface', 'virtual', '--bitrate', 'auto'), ('--bitrate', 'quick'), ('--bitrate', '0'), ('--bitrate', '-5')])
def test_an_interface_that_cannot_find_it_says_what_can(words, capsys):
    assert main(['scan', *words]) == 2
    out = capsys.readouterr()
    assert not out.out and '--bitrate' in out.err and ('socketcan' not in words or 'ip link set can0' in out.err)
