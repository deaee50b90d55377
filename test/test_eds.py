"""EDS files: what is read, and how what is none is refused."""

import pytest
from can_bench import TINY, tiny_layout

from tactile_node.canbus.eds import Identity, check_against, identity_of, load_eds
from tactile_node.errors import ConfigurationError

SMALL = '''[DeviceInfo]
VendorName=nobody
[1018]
ParameterName=Identity
ObjectType=0x9
SubNumber=2
[1018sub0]
ParameterName=count
DataType=0x0005
AccessType=ro
DefaultValue=1
[1018sub1]
ParameterName=Vendor
DataType=0x0007
AccessType=ro
DefaultValue=0x12 ; with a comment
'''


def write(folder, text):
    path = folder / 'device.eds'
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_node_id_enters_the_cob_ids():
    dictionary = load_eds('sim16x16.eds', 32)
    assert dictionary[0x1800][1].default == 0x8000_01A0  # disabled, 0x180 + 32
    assert dictionary[0x1A1F][8].default == 0x210F_1008  # the last taxel: row 15, column 15
    assert identity_of(dictionary) == (0x5C1, 0x1616_0008, 0x0001_0000)


def test_umlauts_of_a_code_page_are_harmless(tmp_path):
    dictionary = load_eds(write(tmp_path, SMALL.encode().replace(b'nobody', b'M\xfcller')), 1)
    assert identity_of(dictionary) == (0x12, None, None)


BAD = {
    'empty': ('', 'object sections'),
    'prose': ('This is no EDS.\n', 'section'),
    'binary': (bytes(range(256)), 'EDS'),
    'other INI file': ('[general]\nkey=value\n', 'object sections'),
    'section twice': (SMALL + '[1018]\nParameterName=x\n', '[1018] again'),
    'key twice': (SMALL + 'DataType=0x0007\n', '"DataType" again'),
    'no DataType': (SMALL.replace('DataType=0x0007\n', ''), 'key "DataType" in section [1018sub1]'),
    'no AccessType': (SMALL.replace('AccessType=ro\nDefaultValue=0x12', 'DefaultValue=0x12'),
                      'key "AccessType"'),
    'no ParameterName': (SMALL.replace('ParameterName=Identity\n', ''), 'in section [1018]'),
    'type no number': (SMALL.replace('0x0007', 'UNSIGNED32'), 'section [1018sub1], key "DataType"'),
    'sub without object': (SMALL + '[2000sub1]\nParameterName=x\nDataType=5\nAccessType=ro\n', '[2000]'),
    'canopen alone knows': (SMALL.replace('VendorName=nobody', 'VendorNumber=many'), 'many')}


@pytest.mark.parametrize(('text', 'says'), BAD.values(), ids=BAD)
def test_bad_eds_is_refused_with_a_sentence(tmp_path, text, says):
    with pytest.raises(ConfigurationError) as refused:
        load_eds(write(tmp_path, text), 1)
    assert says in str(refused.value) and 'device.eds' in str(refused.value) and refused.value.remedy


@pytest.mark.parametrize(('change', 'says'), [
    (('number: 1', 'number: 500'), '0x19F3'),
    (('0x2000, 1, 16', '0x2100, 1, 16'), '8 bits'),
    (('0x2000, 1, 16', '0x2001, 1, 16'), 'no such object')])
def test_layout_must_fit_the_eds(tmp_path, change, says):
    layout = tiny_layout(tmp_path, TINY.replace(*change))
    with pytest.raises(ConfigurationError, match=says):
        check_against(load_eds('sim16x16.eds', 1), layout, 'sim16x16.eds')


@pytest.mark.parametrize(('device', 'accepted'), [
    ((1, 2, 0x0003_0004), True), ((1, 2, 0x0003_0009), True), ((1, 2, 0x0003_0003), False),
    ((1, 2, 0x0004_0004), False), ((9, 2, 0x0003_0004), False), ((1, 9, 0x0003_0004), False),
    ((1, 2, None), False)])
def test_identity_rule(device, accepted):
    assert Identity(1, 2, 0x0003_0004).accepts(Identity(*device)) is accepted


def test_identity_the_eds_does_not_give_is_not_checked():
    assert Identity(1, None, 0).accepts(Identity(1, 77, 88))
