"""`tactile sdo` is tested with recorded frames of another stack, CANopenNode's demo device (node 4)."""

import json

import can
import pytest
from can_bench import INTERFACE, Served, channel_of
from eds_text import record

from tactile_node.cia301.objects import ObjectAddress, parse_address
from tactile_node.cli.main import main
from tactile_node.skin.object_value import WrongValueError, decode_value, encode_value

pytestmark = pytest.mark.bus

#: Pairs of an SDO request and its response, as recorded on the bus.
NAME = [('4008100000000000', '4108100010000000'), ('6000000000000000', '0043414E6F70656E'),
        ('7000000000000000', '1044656D6F4C696E'), ('6000000000000000', '0B75780000000000')]
REAL = [('4020210300000000', '432021031F854541')]
NEGATIVE = [('23112101FBFFFFFF', '6011210100000000')]
TEXT = [('2B21210161620000', '6021210100000000')]
READ_ONLY = [('2318100105000000', '8018100102000106')]
NO_OBJECT = [('4077770000000000', '8077770000000206')]
HEARTBEAT = [('4017100000000000', '4B17100064000000')]
STORE = [('2310100173617665', '6010100100000000')]
STORE_2 = [('2310100273617665', '6010100200000000')]
RESTORE = [('231110016C6F6164', '6011100100000000')]
MAPPING = [('2F001A0000000000', '80001A0000000106')]  # The device refuses this request while the TPDO is valid.

EDS = '[DeviceInfo]\nVendorName=x\n' + record(
    0x2120, {0: (5, None), 3: (8, None, 'R32')}, 'Demo record') + ''.join(
    record(index, {0: (5, None), 1: (7, None, 'COB-ID used by TPDO')}, 'TPDO communication parameter')
    for index in (0x1800, 0x1801))


class Recorded(Served):
    """A server that answers only the recorded requests, in their order, with the recorded responses."""

    def __init__(self, channel, exchange, node_id=4):
        super().__init__(channel)
        self._exchange, self._node_id = list(exchange), node_id
        self.requests = []

    def _serve(self):
        while not self._ends.is_set():
            message = self._bus.recv(0.02)
            if message is None or message.arbitration_id != 0x600 + self._node_id:
                continue
            request = message.data.hex().upper()
            self.requests.append(request)
            if self._exchange and self._exchange[0][0] == request:
                answer = self._exchange.pop(0)[1]
                self._bus.send(can.Message(arbitration_id=0x580 + self._node_id, is_extended_id=False,
                                           data=bytes.fromhex(answer)))


def sdo(capsys, exchange, action, *words, node_id=4):
    """Return the exit code, the standard output, the error output, and the requests that the device received."""
    channel = channel_of('sdo command')
    with Recorded(channel, exchange) as device:
        code = main(['sdo', action, '--interface', INTERFACE, '--channel', channel, '--node-id', str(node_id),
                     '--timeout', '0.5', *words])
    out = capsys.readouterr()
    return code, out.out, out.err, device.requests


@pytest.mark.parametrize(('exchange', 'words', 'kind', 'value'), [
    (NAME, ('0x1008', '--type', 'str'), 'str', 'CANopenDemoLinux'),
    (REAL, ('0x2120:3', '--type', 'f32'), 'f32', pytest.approx(12.345)),
    (REAL, ('0x2120:3',), None, '1f854541'),
    (HEARTBEAT, ('0x1017', '--type', 'u16'), 'u16', 100),
    (HEARTBEAT, ('0x1017:0x0',), None, '6400')])
def test_an_object_is_read_as_the_device_sent_it(exchange, words, kind, value, capsys):
    code, out, _, _ = sdo(capsys, exchange, 'read', *words, '--json')
    found = json.loads(out)
    assert code == 0 and found['type'] == kind and found['value'] == value and found['node_id'] == 4


def test_an_eds_names_objects_and_their_types(tmp_path, capsys):
    eds = tmp_path / 'device.eds'
    eds.write_text(EDS)
    for name in ('R32', 'Demo record.R32', '0x2120:3'):
        code, out, _, _ = sdo(capsys, REAL, 'read', name, '--eds', str(eds), '--json')
        found = json.loads(out)
        assert code == 0 and found['type'] == 'f32' and found['value'] == pytest.approx(12.345)
        assert (found['index'], found['sub'], found['data']) == (0x2120, 3, '1f854541')


def test_a_name_that_several_objects_have_is_refused_before_anything_is_sent(tmp_path, capsys):
    """If the name is ambiguous, canopen's dictionary would choose the last TPDO with this name."""
    eds = tmp_path / 'device.eds'
    eds.write_text(EDS)
    code, _, err, requests = sdo(capsys, [], 'write', 'TPDO communication parameter.COB-ID used by TPDO', '0', '--eds',
                                 str(eds))
    assert code == 2 and '0x1800 sub 1' in err and '0x1801 sub 1' in err and not requests


@pytest.mark.parametrize(('exchange', 'words'), [
    (NEGATIVE, ('0x2111:1', '-5', '--type', 'i32')), (TEXT, ('0x2121:1', 'ab', '--type', 'str')),
    (NEGATIVE, ('0x2111:1', 'FB FF FF FF', '--type', 'hex'))])
def test_an_object_is_written_in_the_bytes_of_its_type(exchange, words, capsys):
    code, _, _, requests = sdo(capsys, exchange, 'write', *words)
    assert code == 0 and requests == [exchange[0][0]]


@pytest.mark.parametrize('words', [
    ('0x1017', '1000'),  # Without a type, the number of bytes is unknown, so 1000 may mean 1000 ms or the bytes 10 00.
    ('0x1017', '70000', '--type', 'u16'), ('0x1017', '-1', '--type', 'u16'), ('0x1017', '1.5', '--type', 'u16'),
    ('1017', '100', '--type', 'u16'),  # Decimal 1017 is the index of a data type, but the user means 0x1017.
    ('5120', '100', '--type', 'u16'),  # Decimal 5120 is the index of an RPDO.
    ('0x1017:300', '1', '--type', 'u16'), ('0x10170', '1', '--type', 'u16'), ('Heartbeat', '1', '--type', 'u16'),
    ('0x1017', 'zz', '--type', 'hex'), ('0x1017', 'ä', '--type', 'str'), ('0x1017', '2', '--type', 'bool'),
    ('0x2121:2', '', '--type', 'str'), ('0x2122', '', '--type', 'hex')])  # canopen sends no request for an empty value.
def test_an_ambiguous_request_is_refused_and_not_sent(words, capsys):
    code, out, err, requests = sdo(capsys, [], 'write', *words)
    assert code == 2 and not out and 'expected' in err and not requests


@pytest.mark.parametrize(('exchange', 'words', 'part'), [
    (NO_OBJECT, ('read', '0x7777'), '0x06020000'),
    (READ_ONLY, ('write', '0x1018:1', '5', '--type', 'u32'), '0x06010002'),
    (HEARTBEAT, ('read', '0x1017', '--type', 'u32'), '6400')])
def test_an_abort_or_a_type_of_another_size_is_one_of_our_errors(exchange, words, part, capsys):
    code, out, err, _ = sdo(capsys, exchange, *words)
    assert code == 2 and not out and part in err and err.startswith('tactile: error: node 4, object ')


def test_a_number_that_json_lacks_is_null(capsys):
    nan = [('4020210300000000', '432021030000C07F')]
    code, out, _, _ = sdo(capsys, nan, 'read', '0x2120:3', '--type', 'f32', '--json')
    assert code == 0 and json.loads(out, parse_constant=pytest.fail)['value'] is None


def test_a_silent_node_is_reported(capsys):
    code, out, err, _ = sdo(capsys, [], 'read', '0x1000', node_id=5)
    assert code == 2 and not out and 'an answer by SDO within 0.5 s' in err


@pytest.mark.parametrize(('words', 'exchange', 'part'), [
    (['store'], STORE, 'stored'), (['restore'], RESTORE, 'reset'), (['store', '--sub', '2'], STORE_2, 'stored')])
def test_parameters_are_stored_and_restored_by_their_signatures(words, exchange, part, capsys):
    code, out, _, requests = sdo(capsys, exchange, *words)
    assert code == 0 and part in out and requests == [exchange[0][0]]


def test_a_write_to_an_object_that_determines_tpdos_causes_a_warning(capsys):
    code, _, err, requests = sdo(capsys, MAPPING, 'write', '0x1A00', '0', '--type', 'u8')
    assert code == 2 and 'warning' in err and '0x06010000' in err and len(requests) == 1


@pytest.mark.parametrize('words', [('--timeout', '0'), ('--timeout', 'nan'), ('--node-id', '0'), ('--node-id', '128'),
                                   ('--eds', 'nowhere.eds')])
def test_bad_options_are_refused(words, capsys):
    code, _, _, requests = sdo(capsys, [], 'read', '0x1000', *words)
    assert code == 2 and not requests


def test_numbers_are_those_of_the_wire():
    assert parse_address('0X1a00:0x08') == ObjectAddress(0x1A00, 8)
    assert encode_value('u24', '0x010203') == bytes.fromhex('030201') and encode_value('bool', '1') == b'\x01'
    assert encode_value('i64', '-1') == 8 * b'\xff' and encode_value('f64', '1') == bytes.fromhex('000000000000F03F')
    assert decode_value('i24', bytes.fromhex('FFFFFF')) == -1 and decode_value('bool', b'\x01') == 1
    assert decode_value('str', '€\0'.encode()) == '€' and decode_value('str', b'\xe9') == 'é'
    with pytest.raises(WrongValueError):
        decode_value('u16', b'\x01')
