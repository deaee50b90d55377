"""Tests for the constants and names from CiA 301, and for the length and priority of CAN frames."""

import random

import pytest

from tactile_node.cia301 import objects, sdo
from tactile_node.cia301.frame_bits import CanFrame, arbitration, load_bits, worst_case_bits
from tactile_node.cia301.objects import reserved_for, service_of


@pytest.mark.parametrize(('can_ids', 'service'), [
    ((0x000,), 'nmt'), ((0x081, 0x0FF), 'emcy'), ((0x100,), 'time'), ((0x581, 0x5FF, 0x601, 0x67F), 'sdo'),
    ((0x701, 0x77F), 'heartbeat'), ((0x001, 0x080, 0x101, 0x580, 0x600, 0x680, 0x700, 0x780, 0x7FF), 'foreign')])
def test_services_of_the_predefined_connection_set(can_ids, service):
    assert {service_of(can_id) for can_id in can_ids} == {service}


def test_restricted_can_ids():
    free = [can_id for can_id in range(0x800) if reserved_for(can_id) is None]
    expected = [0x080, *range(0x081, 0x101), *range(0x181, 0x581), 0x600, *range(0x680, 0x6E0), 0x700]
    assert free == expected


def test_cob_ids_of_the_services():
    assert (objects.NMT, objects.SYNC, objects.EMCY) == (0x000, 0x080, 0x080)
    assert (objects.SDO_RESPONSE, objects.SDO_REQUEST) == (0x580, 0x600)
    assert objects.HEARTBEAT == 0x700


def test_objects_and_pdos():
    assert (objects.COB_ID_SYNC, objects.PRODUCER_HEARTBEAT_TIME, objects.IDENTITY) == (0x1005, 0x1017, 0x1018)
    assert (objects.TPDO_COMMUNICATION, objects.TPDO_MAPPING) == (0x1800, 0x1A00)
    assert (objects.EVERY_SYNC, objects.MAX_SYNCHRONOUS) == (1, 240)
    assert (objects.MANUFACTURER_EVENT, objects.SAM_MPDO) == (254, 254)
    assert (objects.MAX_PDO_BITS, objects.MPDO_DATA_BITS, objects.MAX_TPDOS) == (64, 32, 512)


def test_commands_of_a_block_upload():
    requests = (sdo.INITIATE_BLOCK_REQUEST, sdo.START_BLOCK_REQUEST, sdo.ACKNOWLEDGE_BLOCK_REQUEST,
                sdo.END_BLOCK_REQUEST)
    assert requests == (0xA0, 0xA3, 0xA2, 0xA1)
    assert (sdo.INITIATE_BLOCK_RESPONSE, sdo.END_BLOCK_RESPONSE) == (0xC6, 0xC1)


@pytest.mark.parametrize(('command', 'name'), [
    (0x01, 'start'), (0x02, 'stop'), (0x80, 'enter pre-operational'), (0x81, 'reset node'),
    (0x82, 'reset communication'), (0x83, 'command 0x83')])
def test_names_of_nmt_commands(command, name):
    assert objects.command_name(command) == name


@pytest.mark.parametrize(('state', 'name'), [
    (0x00, 'BOOT-UP'), (0x04, 'STOPPED'), (0x05, 'OPERATIONAL'), (0x7F, 'PRE-OPERATIONAL'),
    (0x06, 'unknown NMT state 0x06'), (None, 'never heard')])
def test_names_of_nmt_states(state, name):
    assert objects.state_name(state) == name


# Generator polynomial x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1, from Bosch CAN 2.0, part A, 3.1.1.
GENERATOR = 0b1100_0101_1001_1001


def remainder(bits: str) -> str:
    """Return the CRC sequence of ``bits``, computed by long division."""
    number = int(bits, 2) << 15
    while number.bit_length() > 15:
        number ^= GENERATOR << number.bit_length() - 16
    return f'{number:015b}'


def stuffed(bits: str) -> str:
    sent = ''
    for bit in bits:
        sent += bit
        if sent[-5:] in ('00000', '11111'):
            sent += '1' if bit == '0' else '0'
    return sent


def on_the_wire(frame: CanFrame) -> str:
    """Return the bits of a frame on the wire, including the three intermission bits after it (ISO 11898-1)."""
    remote = '1' if frame.is_remote else '0'
    if frame.is_extended:
        head = f'0{frame.can_id >> 18:011b}11{frame.can_id & 0x3FFFF:018b}{remote}00'
    else:
        head = f'0{frame.can_id:011b}{remote}00'
    body = head + f'{frame.dlc:04b}' + ''.join(f'{byte:08b}' for byte in frame.data)
    return stuffed(body + remainder(body)) + '1' + '01' + '1111111' + '111'


def drawn(rng: random.Random) -> CanFrame:
    """Return a random frame, often with long runs of equal bits like the counts of a skin at rest."""
    is_extended, is_remote = rng.random() < 0.3, rng.random() < 0.1
    can_id = rng.choice((0, 0x7FF, 0x080, 0x1A0, rng.getrandbits(11)))
    data = bytes(rng.choice((0, 0, 0xFF, 0x55, 0x1F, 0x0F, rng.getrandbits(8))) for _ in range(rng.randrange(9)))
    return CanFrame(can_id << 18 | rng.getrandbits(18) if is_extended else can_id, b'' if is_remote else data,
                    is_extended, is_remote, len(data) if is_remote else 0)


def test_no_frame_is_longer_than_the_worst_case():
    """In Bosch CAN 2.0, a stuff bit can follow the first five equal bits, and then every four more bits."""
    rng = random.Random(4)
    assert all(len(on_the_wire(frame)) <= worst_case_bits(frame) for frame in (drawn(rng) for _ in range(5000)))
    assert [worst_case_bits(CanFrame(1, bytes(n))) for n in range(9)] == [load_bits(n) for n in range(9)]
    assert worst_case_bits(CanFrame(1, bytes(8), is_extended=True)) == 160


def test_arbitration_is_by_the_bits_as_they_are_sent():
    """The frame that sends the first dominant bit wins the arbitration.

    With the same base identifier, a standard frame wins over an extended frame, and a data frame wins over a remote
    frame.
    """
    rng = random.Random(5)
    for _ in range(2000):
        one, other = drawn(rng), drawn(rng)
        # Before stuffing, the arbitration fields are 11 identifier bits, RTR or SRR, IDE, 18 identifier bits and RTR.
        fields = [(f'{frame.can_id >> 18:011b}11{frame.can_id & 0x3FFFF:018b}{frame.is_remote:d}'
                   if frame.is_extended else f'{frame.can_id:011b}{frame.is_remote:d}0').ljust(32, '0')
                  for frame in (one, other)]
        assert (arbitration(one) < arbitration(other)) == (fields[0] < fields[1])
