"""`tactile scan` is tested with hand-written devices that follow CiA 301 and do not use canopen."""

import json
import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import can
import pytest
from can_bench import INTERFACE, Served, channel_of, serial_line
from eds_text import record

from tactile_node.cli.main import main

pytestmark = pytest.mark.bus

ABORT = bytes.fromhex('00000206')  # Abort code for an object that does not exist.


class Device(Served):
    """An SDO server for expedited and segmented uploads that also sends a heartbeat.

    The server records every received frame.
    """

    def __init__(self, channel, node_id, objects, heartbeat: bytes | None = b'\x05'):
        super().__init__(channel)
        self._node_id, self._objects, self._heartbeat = node_id, objects, heartbeat
        self._rest, self._toggle = b'', 0
        self.received = []

    def _send(self, can_id, data):
        self._bus.send(can.Message(arbitration_id=can_id + self._node_id, data=data, is_extended_id=False))

    def _serve(self):
        due = 0.0
        while not self._ends.is_set():
            if self._heartbeat is not None and time.monotonic() >= due:
                self._send(0x700, self._heartbeat)
                due = time.monotonic() + 0.1
            message = self._bus.recv(0.02)
            if message is None:
                continue
            self.received.append(message)
            if message.arbitration_id == 0x600 + self._node_id:
                self._send(0x580, self._answer(bytes(message.data)))

    def _answer(self, request):
        if request[0] & 0xE0 == 0x60:  # The request asks for the next segment.
            self._toggle ^= 0x10
            part, self._rest = self._rest[:7], self._rest[7:]
            return bytes([(self._toggle ^ 0x10) | (7 - len(part)) << 1 | (not self._rest)]) + part.ljust(7, b'\0')
        key, where = (request[1] | request[2] << 8, request[3]), request[1:4]
        if request[0] != 0x40 or key not in self._objects:
            return b'\x80' + where + ABORT
        value = self._objects[key]
        if len(value) <= 4:
            return bytes([0x43 | (4 - len(value)) << 2]) + where + value.ljust(4, b'\0')
        self._rest, self._toggle = value, 0
        return b'\x41' + where + len(value).to_bytes(4, 'little')


def u32(value):
    return value.to_bytes(4, 'little')


SKIN = {(0x1000, 0): u32(0x194), (0x1008, 0): b'A skin by another maker', (0x1017, 0): b'\x64\x00',
        (0x1018, 1): u32(0x5C1), (0x1018, 2): u32(0x1616_0008), (0x1018, 3): u32(0x0001_0000)}


def scan(capsys, channel, *words):
    code = main(['scan', '--interface', INTERFACE, '--channel', channel, '--listen', '0.6', *words])
    out = capsys.readouterr()
    return code, out.out, out.err


def test_nodes_are_found_with_identity_state_and_layout(capsys):
    channel = channel_of('scanned')
    with Device(channel, 5, SKIN) as skin, Device(channel, 100, {(0x1000, 0): u32(0)}, heartbeat=None), \
            Device(channel, 127, {}):
        code, out, _ = scan(capsys, channel, '--json')
        requests = {message.data[0] & 0xE0 for message in skin.received if message.arbitration_id == 0x605}
    first, mute, bare = map(json.loads, out.splitlines())
    assert code == 0 and [node['node_id'] for node in (first, mute, bare)] == [5, 100, 127]
    assert first['name'] == 'A skin by another maker' and first['state'] == 'OPERATIONAL' and first['answers']
    assert first['identity'] == {'vendor': 0x5C1, 'product': 0x1616_0008, 'revision': 0x0001_0000}
    assert first['heartbeat_time'] == 0.1 and first['heartbeat_period'] == pytest.approx(0.1, abs=0.08)
    assert [path.rsplit('/', 1)[1] for path in first['layouts']] == ['sim16x16.yaml']
    assert mute['state'] is None and mute['answers'] and not mute['layouts'] and mute['name'] is None
    assert bare['answers'] and bare['device_type'] is None  # An abort also counts as a response.
    assert requests == {0x40, 0x60}, 'the scan must only read'


def test_a_passive_scan_sends_nothing(capsys):
    channel = channel_of('passive')
    with Device(channel, 5, SKIN) as skin:
        code, out, _ = scan(capsys, channel, '--passive')
        assert code == 0 and 'node 5' in out and 'not asked' in out and not skin.received


def test_a_heartbeat_of_more_than_one_byte_is_heard_and_an_empty_one_is_not(capsys):
    channel = channel_of('long heartbeat')
    with Device(channel, 5, SKIN, heartbeat=b'\x85\x00'), Device(channel, 6, SKIN, heartbeat=b''):
        code, out, _ = scan(capsys, channel, '--passive', '--json')
    found, = map(json.loads, out.splitlines())
    assert code == 0 and (found['node_id'], found['state']) == (5, 'OPERATIONAL')


def test_only_the_nodes_that_were_named_are_asked(capsys):
    channel = channel_of('named')
    with Device(channel, 5, SKIN, heartbeat=None) as skin, Device(channel, 6, SKIN, heartbeat=None):
        code, out, _ = scan(capsys, channel, '--node-id', '5')
        asked = {message.arbitration_id for message in skin.received if message.arbitration_id > 0x600}
    assert code == 0 and 'node 5' in out and 'node 6' not in out and asked == {0x605}


def test_two_devices_with_one_node_id_are_named(capsys):
    channel = channel_of('doubled')
    with Device(channel, 5, SKIN), Device(channel, 5, SKIN), Device(channel, 6, SKIN):
        code, out, _ = scan(capsys, channel, '--node-id', '5,6')
    first, second = out.splitlines()
    assert code == 0 and 'node 5' in first and 'several devices have this node-ID' in first
    assert 'node 6' in second and 'several devices' not in second


@pytest.mark.parametrize('words', [(), ('--passive',)])
def test_a_silent_bus_is_reported(words, capsys):
    code, out, err = scan(capsys, channel_of('silent'), '--node-id', '1', *words)
    assert code == 1 and not out and 'Nothing was received' in err


def test_a_folder_of_eds_files_is_compared_too(tmp_path, capsys):
    eds = tmp_path / 'other.eds'
    eds.write_text('[DeviceInfo]\nVendorName=x\n' + record(0x1018, {1: (7, 0x77), 2: (7, 0x88)}))
    (tmp_path / 'broken.eds').write_text('nothing')
    channel = channel_of('other maker')
    with Device(channel, 5, {(0x1000, 0): u32(0), (0x1018, 1): u32(0x77), (0x1018, 2): u32(0x88)}):
        code, out, err = scan(capsys, channel, '--json', '--eds', str(tmp_path), '--node-id', '5')
    assert code == 0 and json.loads(out)['eds'] == [str(eds)] and 'broken.eds' in err


def test_frames_that_were_all_damaged_are_not_silence(capsys):
    """A wrong bit rate, or an adapter with another line format, produces damaged frames only."""
    with serial_line() as (adapter, port), ThreadPoolExecutor() as pool:
        ends = threading.Event()

        def serve():
            while not ends.wait(0.02):
                os.write(adapter, b'nonsense\r')
        served = pool.submit(serve)
        try:
            code = main(['scan', '--interface', 'slcan', '--channel', port, '--listen', '0.6', '--passive'])
        finally:
            ends.set()
        served.result(60)
    out = capsys.readouterr()
    assert code == 1 and not out.out and 'damaged' in out.err and 'Nothing was received' not in out.err
