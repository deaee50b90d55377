"""`tactile simulate --pty` in real time, read by a plain client.

The client must receive the frames that a real wire would have carried, and no frame earlier than on the wire.
"""

import json
import os
import select
import signal
import subprocess
import sys
import time
import tty
from pathlib import Path

import pytest
from waiting import until

ROOT = Path(__file__).resolve().parents[1]
NODES = (32, 64)
#: COB-IDs of each node's TPDOs, in the order in which the node sends them.
COB_IDS = [[base + node_id + i for base in bases for i in range(4)]
           for node_id, bases in zip(NODES, ((0x180, 0x280, 0x380, 0x480), (0x380, 0x480, 0x180, 0x280)))]
#: Expected order on the wire: of the next frames of both nodes, the frame with the lower COB-ID is sent first. The
#: later frames of node 64 must wait until its frames from 0x4C0 on have been sent.
IN_ORDER = [base + i for base in (0x1A0, 0x2A0, 0x3A0, 0x3C0, 0x4A0, 0x4C0, 0x1C0, 0x2C0) for i in range(4)]
BITRATE = 250_000
#: Time limit on a busy machine [s].
TIMEOUT = 60.0
#: Durations of a frame with 8 bytes and of a frame without data, both with the most stuff bits [s].
EIGHT = 135 / BITRATE
NONE = 55 / BITRATE
DELAY = 0.002  # Delay in seconds.

pytestmark = pytest.mark.bus


class Client:
    """A program that opens the port of a simulated skin, which runs in another process."""

    def __init__(self, folder: Path, *options: str):
        self._report = folder / 'wire.jsonl'
        command = [sys.executable, '-m', 'tactile_node.cli.main', 'simulate', '--pty', '--link', str(folder / 'can'),
                   '--layout', 'sim8x8_16bit.yaml', '--node-id', ','.join(map(str, NODES)), '--jitter', '0',
                   '--bitrate', str(BITRATE), '--delay', str(DELAY), '--report', str(self._report), *options]
        self.process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        assert 'node 32, 64' in self.process.stdout.readline()
        self._port = os.open(folder / 'can', os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._port)
        self.send('O')

    def send(self, line: str) -> None:
        os.write(self._port, line.encode() + b'\r')

    def take(self, count: int) -> list[int]:
        """Return the COB-IDs of the next ``count`` frames."""
        read, found = b'', []
        while not read.endswith(b'\r') or len(found) < count:
            assert select.select([self._port], [], [], TIMEOUT)[0], read
            read += os.read(self._port, 1 << 16)
            found = _can_ids(read)
        assert len(found) == count, found[count:]
        return found

    def start(self) -> None:
        """Enable all TPDOs and send NMT start.

        The response to a later SDO request shows that the wire has carried the NMT start.
        """
        for node_id, can_ids in zip(NODES, COB_IDS):
            for number, can_id in enumerate(can_ids):
                self.send(f't{0x600 + node_id:03X}823{number:02X}1801{can_id & 0xFF:02X}{can_id >> 8:02X}0000')
                assert self.take(1) == [0x580 + node_id]
        self.send('t00020100')
        self.send('t6208' + '4000180000000000')  # SDO upload of 0x1800 sub 0.
        assert self.take(1) == [0x5A0]

    def report(self) -> dict:
        before = self._reports()
        self.process.send_signal(signal.SIGUSR1)
        until(lambda: len(self._reports()) > len(before), TIMEOUT)
        return json.loads(self._reports()[-1])

    def _reports(self) -> list[str]:
        return self._report.read_text(encoding='utf-8').split('\n')[:-1] if self._report.exists() else []

    def end(self) -> None:
        os.close(self._port)
        self.process.terminate()
        self.process.wait()


def _can_ids(read: bytes) -> list[int]:
    """Return the COB-IDs of all lines that contain frames, except boot-up messages."""
    return [int(line[1:4], 16) for line in read.split(b'\r') if line[:1] == b't' and line[1:2] != b'7']


@pytest.fixture
def client(tmp_path):
    client = Client(tmp_path)
    yield client
    client.end()


def test_sweeps_come_in_the_order_of_arbitration_and_never_before_their_time(client):
    client.start()
    client.report()
    begin = time.monotonic()
    for _ in range(10):
        client.send('t0800')
        assert client.take(32) == IN_ORDER
    took, report = time.monotonic() - begin, client.report()
    assert took >= 10 * (NONE + DELAY + 32 * EIGHT)
    assert (report['sweeps'], report['skipped'], report['lost'], report['handed']) == (20, 0, 0, 320)
    assert report['frames'] == 10 + 320
    assert report['load'] * report['seconds'] == pytest.approx(10 * NONE + 320 * EIGHT)
    assert 0 < report['late_p50'] <= report['late_p99'] <= report['late_max']


def test_wire_time_can_be_switched_off(tmp_path):
    """Without the simulated wire, each device sends its whole sweep at once, one device after the other.

    With --no-wire, the command reports no wire.
    """
    client = Client(tmp_path, '--no-wire')
    try:
        client.start()
        client.send('t0800')
        assert client.take(32) == COB_IDS[0] + COB_IDS[1]
        client.process.terminate()
        client.process.wait()
        assert not client._reports()
    finally:
        client.end()
