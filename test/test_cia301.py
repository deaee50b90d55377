"""The facts of CiA 301, against the numbers that the standard prints."""

import pytest

from tactile_node.cia301 import connection_set, nmt, objects, pdo, sdo
from tactile_node.cia301.connection_set import reserved_for, service_of


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
    assert (connection_set.NMT, connection_set.SYNC, connection_set.EMCY) == (0x000, 0x080, 0x080)
    assert (connection_set.SDO_RESPONSE, connection_set.SDO_REQUEST) == (0x580, 0x600)
    assert connection_set.HEARTBEAT == 0x700


def test_objects_and_pdos():
    assert (objects.COB_ID_SYNC, objects.PRODUCER_HEARTBEAT_TIME, objects.IDENTITY) == (0x1005, 0x1017, 0x1018)
    assert (objects.TPDO_COMMUNICATION, objects.TPDO_MAPPING) == (0x1800, 0x1A00)
    assert (pdo.EVERY_SYNC, pdo.MAX_SYNCHRONOUS, pdo.MANUFACTURER_EVENT, pdo.SAM_MPDO) == (1, 240, 254, 254)
    assert (pdo.MAX_PDO_BITS, pdo.MPDO_DATA_BITS, pdo.MAX_TPDOS) == (64, 32, 512)


def test_commands_of_a_block_upload():
    requests = (sdo.INITIATE_BLOCK_REQUEST, sdo.START_BLOCK_REQUEST, sdo.ACKNOWLEDGE_BLOCK_REQUEST,
                sdo.END_BLOCK_REQUEST)
    assert requests == (0xA0, 0xA3, 0xA2, 0xA1)
    assert (sdo.INITIATE_BLOCK_RESPONSE, sdo.END_BLOCK_RESPONSE) == (0xC6, 0xC1)


@pytest.mark.parametrize(('command', 'name'), [
    (0x01, 'start'), (0x02, 'stop'), (0x80, 'enter pre-operational'), (0x81, 'reset node'),
    (0x82, 'reset communication'), (0x83, 'command 0x83')])
def test_names_of_nmt_commands(command, name):
    assert nmt.command_name(command) == name


@pytest.mark.parametrize(('state', 'name'), [
    (0x00, 'BOOT-UP'), (0x04, 'STOPPED'), (0x05, 'OPERATIONAL'), (0x7F, 'PRE-OPERATIONAL'),
    (0x06, 'unknown NMT state 0x06'), (None, 'never heard')])
def test_names_of_nmt_states(state, name):
    assert nmt.state_name(state) == name
