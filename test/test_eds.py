"""Tests for reading EDS files and for refusing files that are not valid EDS files."""

import pytest
from can_bench import TINY, tiny_layout

from tactile_node.errors import ConfigurationError
from tactile_node.skin.eds import load_eds
from tactile_node.skin.eds_rules import Identity, check_against, identity_of

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
    assert dictionary[0x1800][1].default == 0x8000_01A0  # The TPDO is disabled, and its COB-ID is 0x180 + 32.
    assert dictionary[0x1A1F][8].default == 0x210F_1008  # This entry maps the last taxel, in row 15 and column 15.
    assert identity_of(dictionary, 'device.eds') == (0x5C1, 0x1616_0008, 0x0001_0000)


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
    'canopen alone knows': (SMALL.replace('VendorName=nobody', 'VendorNumber=many'), 'many'),
    'array without DataType': (SMALL + '[2000]\nParameterName=A\nObjectType=0x8\nAccessType=ro\nCompactSubObj=4\n',
                               '"DataType" in section [2000]'),
    'number of elements': (SMALL + '[2000]\nParameterName=A\nObjectType=0x8\nDataType=0x0006\nAccessType=ro\n'
                           'CompactSubObj=many\n', 'CompactSubObj'),
    'empty DataType': (SMALL.replace('DataType=0x0007', 'DataType='), '"DataType" in section [1018sub1]'),
    # An object without ObjectType counts as a VAR.
    'empty ObjectType': (SMALL.replace('ObjectType=0x9', 'ObjectType='), '"DataType" in section [1018]'),
    'bit rate': (SMALL.replace('VendorName', 'BaudRate_1000=yes\nVendorName'),
                 'section [DeviceInfo], key "BaudRate_1000"'),
    'vendor number': (SMALL.replace('VendorName', 'VendorNumber=many\nVendorName'),
                      'section [DeviceInfo], key "VendorNumber"'),
    'sub twice': (SMALL + '[1018SUB1]\nParameterName=x\nDataType=5\nAccessType=ro\n', '[1018sub1] again as [1018SUB1]')}


@pytest.mark.parametrize(('text', 'says'), BAD.values(), ids=BAD)
def test_bad_eds_is_refused_with_a_sentence(tmp_path, text, says):
    with pytest.raises(ConfigurationError) as refused:
        load_eds(write(tmp_path, text), 1)
    assert says in str(refused.value) and 'device.eds' in str(refused.value) and refused.value.remedy


OCTAL = SMALL.replace('VendorName', 'VendorNumber=001\nBaudRate_1000=01\nVendorName').replace('=0x9', '=011').replace(
    'DataType=0x0007', 'DataType=0007').replace('=0x12 ;', '=0022 ;')


TEXT = '[1008]\nParameterName=x\nDataType=0011\nAccessType=ro\nDefaultValue=007\n'


def test_a_number_with_a_leading_0_is_octal(tmp_path):
    """According to CiA 306, a leading 0 marks an octal number, as in C.

    A leading 0 in a string stays unchanged.
    """
    text = OCTAL + TPDO.format('$NODEID+0600') + TEXT
    dictionary = load_eds(write(tmp_path, text), 5)
    assert identity_of(dictionary, 'device.eds').vendor == 0o22
    assert dictionary.device_information.vendor_number == 1
    assert dictionary.device_information.allowed_baudrates == {1_000_000}
    assert dictionary[0x1800][1].default == 0x185 and dictionary[0x1008].default == '007'


@pytest.mark.parametrize('number', ['08', '019', '0x'])
def test_text_that_is_not_a_number_in_any_base_is_refused(tmp_path, number):
    with pytest.raises(ConfigurationError, match='VendorNumber'):
        load_eds(write(tmp_path, OCTAL.replace('VendorNumber=001', f'VendorNumber={number}')), 5)


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


def test_identity_the_eds_does_not_give_is_named_and_not_checked():
    assert Identity(1, None, 0).accepts(Identity(1, 77, 88))
    assert Identity(1, None, 0).not_given == ('product', 'revision') and Identity(1, 2, 3).not_given == ()


TPDO = '''[1800]
ParameterName=TPDO
ObjectType=0x9
SubNumber=2
[1800sub0]
ParameterName=count
DataType=0x0005
AccessType=ro
DefaultValue=1
[1800sub1]
ParameterName=COB-ID
DataType=0x0007
AccessType=rw
DefaultValue={}
'''


@pytest.mark.parametrize(('written', 'read'), [
    ('0x80+$NODEID', 0x85), ('$NodeID + 0x180', 0x185), ('$NODEID+0x40000180', 0x4000_0185),
    ('0x80000180+$NODEID', 0x8000_0185), ('0x185 ; free', 0x185), ('', None)])
def test_cob_ids_as_vendors_write_them(tmp_path, written, read):
    assert load_eds(write(tmp_path, SMALL + TPDO.format(written)), 5)[0x1800][1].default == read


ODD = {
    'keys in another case': SMALL.replace('ParameterName', 'parametername').replace('DataType', 'DATATYPE')
    .replace('Default', 'default'),
    '^Z': SMALL + '\x1a', '^Z after DOS lines': SMALL.replace('\n', '\r\n') + '\x1a\x1a',
    'UTF-16': SMALL.encode('utf-16'), 'UTF-16, big-endian': b'\xfe\xff' + SMALL.encode('utf-16-be'),
    'umlauts of a code page': SMALL.encode().replace(b'nobody', b'M\xfcller'),
    # In this array, canopen would mistake the vendor-ID for the product code.
    'identity as an array': SMALL.replace('ObjectType=0x9', 'ObjectType=0x8'),
    'section in lower case': SMALL.replace('DeviceInfo', 'deviceinfo'),
    'index in lower case': SMALL + TPDO.format(1).replace('1800', '1a0f'),
    'SUB in capitals': SMALL.replace('1018sub', '1018SUB'),
    'inline comment on a type': SMALL.replace('DataType=0x0007', 'DataType=0x0007 ; UNSIGNED32'),
    'empty PDOMapping and limits': SMALL + 'PDOMapping=\nLowLimit=\nHighLimit=\n',
    'empty numbers of the device': SMALL.replace('VendorName',
                                                 'VendorNumber=\nBaudRate_1000=\nGranularity=\nVendorName'),
    'empty commissioning': SMALL + '[DeviceComissioning]\nNodeID=\nBaudrate=\n',
    'empty dummy': SMALL + '[DummyUsage]\nDummy0001=\n',
    'fewer comments than announced': SMALL + '[Comments]\nLines=2\nLine1=x\n',
    'more entries announced than there are': SMALL.replace('SubNumber=2', 'SubNumber=9'),
    'no count': SMALL.replace('SubNumber=2\n', ''),
    'a list that names absent objects': SMALL + '[OptionalObjects]\nSupportedObjects=5\n1=0x2000\n',
    'CompactSubObj empty': SMALL.replace('SubNumber=2', 'SubNumber=2\nCompactSubObj=')}


@pytest.mark.parametrize('text', ODD.values(), ids=ODD)
def test_harmless_oddities_are_read(tmp_path, text):
    assert identity_of(load_eds(write(tmp_path, text), 5), 'device.eds') == (0x12, None, None)


def test_compact_sub_objects(tmp_path):
    array = '[2000]\nParameterName=A\nObjectType=0x8\nDataType=0x0006\nAccessType=ro\nCompactSubObj=4\n'
    dictionary = load_eds(write(tmp_path, SMALL + array), 5)
    assert [len(dictionary[0x2000][sub]) for sub in range(1, 5)] == [16] * 4


IDENTITY_AS_VAR = '''[DeviceInfo]
VendorName=nobody
[1018]
ParameterName=Identity
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x12
'''


@pytest.mark.parametrize(('text', 'says'), [
    (IDENTITY_AS_VAR, 'section [1018]'),
    (IDENTITY_AS_VAR.replace('ObjectType=0x7\n', ''), 'section [1018]'),
    # canopen skips objects of the type DEFSTRUCT.
    (IDENTITY_AS_VAR.replace('0x7\n', '0x6\n'), 'section [1018]'),
    # For these malformed numbers, canopen would return no value at all.
    (SMALL.replace('0x12 ;', '0x12G4 ;'), 'section [1018sub1], key "DefaultValue"'),
    (SMALL.replace('0x12 ;', '018 ;'), 'section [1018sub1], key "DefaultValue"'),
    # This vendor-ID is a VISIBLE_STRING.
    (SMALL.replace('DataType=0x0007', 'DataType=0x0009'), 'section [1018sub1]'),
    # This vendor-ID is a REAL32.
    (SMALL.replace('DataType=0x0007', 'DataType=0x0008').replace('0x12 ;', '18 ;'), 'section [1018sub1]'),
    (SMALL.replace('1018sub1', '1018SUB01').replace('0x12 ;', 'ACME ;'), 'section [1018sub01], key "DefaultValue"')])
def test_an_identity_that_cannot_be_compared_is_refused(tmp_path, text, says):
    """If this EDS were accepted, the identity would not be checked, or the check would end in a TypeError."""
    with pytest.raises(ConfigurationError) as refused:
        identity_of(load_eds(write(tmp_path, text), 5), 'device.eds')
    assert says in str(refused.value) and 'device.eds' in refused.value.where and refused.value.remedy


def objects_of_tiny(**types):
    """Return the EDS sections of the objects that the layout TINY uses.

    ``types`` maps an index to its ObjectType and DataType.
    """
    sections = []
    for index, (kind, data_type) in ({'1005': ('0x7', 7), '1017': ('0x7', 6), '2000': ('0x8', 6)} | types).items():
        sections.append(f'[{index}]\nParameterName=x\nObjectType={kind}\nDataType={data_type}\nAccessType=rw\n')
        subs = () if kind == '0x7' else range(9)
        sections += [f'[{index}sub{sub}]\nParameterName=x{sub}\nDataType={data_type if sub else 5}\nAccessType=rw\n'
                     for sub in subs]
    return ''.join(sections)


RECORDS = {f'{base + i:X}': ('0x9', 7) for base in (0x1800, 0x1A00) for i in range(3)}


def check_tiny(folder, **types):
    path = write(folder, SMALL + objects_of_tiny(**(RECORDS | types)))
    check_against(load_eds(path, 5), tiny_layout(folder), str(path))


@pytest.mark.parametrize('types', [
    {}, {'1800': ('0x8', 7)}, {'1A02': ('0x8', 7)}, {'2000': ('0x9', 6)}, {'1017': ('0x7', 7)}])
def test_records_may_be_declared_as_arrays(tmp_path, types):
    check_tiny(tmp_path, **types)


@pytest.mark.parametrize(('types', 'section'), [
    ({'1800': ('0x7', 7)}, '[1800]'), ({'1A02': ('0x7', 7)}, '[1A02]'), ({'2000': ('0x7', 6)}, '0x2000 sub 1'),
    ({'1005': ('0x9', 7)}, '[1005]'), ({'1005': ('0x8', 7)}, '[1005]'), ({'1017': ('0x9', 6)}, '[1017]'),
    ({'1005': ('0x7', 5)}, '[1005]'), ({'1017': ('0x7', 5)}, '[1017]'), ({'1017': ('0x7', 9)}, '[1017]'),
    ({'1801': ('0x9', 5)}, '[1801sub1]'), ({'1A00': ('0x9', 6)}, '[1A00sub1]')])
def test_objects_of_another_shape_or_too_narrow_are_refused(tmp_path, types, section):
    """A value whose declared type is too narrow is truncated on reading and could then equal another value."""
    with pytest.raises(ConfigurationError) as refused:
        check_tiny(tmp_path, **types)
    assert section in str(refused.value) and 'device.eds' in str(refused.value) and refused.value.remedy


ARRAY = '[2000]\nParameterName=A\nObjectType=0x8\nSubNumber=9\n'
COMPACT = ARRAY + 'DataType=0x0006\nAccessType=ro\nPDOMapping=1\nCompactSubObj=3\n'


def element(sub, access='ro', mapping='PDOMapping=1\n'):
    return f'[2000sub{sub}]\nParameterName=x{sub}\nDataType=6\nAccessType={access}\n{mapping}'


ELEMENTS = ''.join(element(sub) for sub in (1, 2, 3))


def check_taxels(folder, taxels):
    """Check an EDS with the sections ``taxels`` against the layout TINY.

    TINY maps 0x2000 sub 1, 2 and 3 with 16 bits each.
    """
    rest = objects_of_tiny(**RECORDS)
    path = write(folder, SMALL + rest[:rest.index('[2000]')] + rest[rest.index('[1800]'):] + taxels)
    check_against(load_eds(path, 5), tiny_layout(folder), str(path))
    return path


@pytest.mark.parametrize('taxels', [
    ARRAY + ELEMENTS, COMPACT, COMPACT.replace('=3', '=03').replace('Mapping=1', 'Mapping=01'),
    ARRAY + ELEMENTS.replace('PDOMapping=1\n', ''), ARRAY.replace('0x8', '0x9') + ELEMENTS,
    *(ARRAY + ELEMENTS.replace('=ro', f'={access}') for access in ('rw', 'rwr', 'const', 'RO'))])
def test_taxels_that_a_tpdo_may_map_are_accepted(tmp_path, taxels):
    check_taxels(tmp_path, taxels)


@pytest.mark.parametrize(('taxels', 'at', 'says'), [
    # The array declares nine elements but lists none.
    (ARRAY, '[2000]', '[2000sub1]'),
    # canopen would derive the missing element from sub 1.
    (ARRAY + ELEMENTS.replace('[2000sub3]', '[2000sub4]'), '[2000]', '[2000sub3]'),
    (COMPACT.replace('CompactSubObj=3', 'CompactSubObj=2'), 'CompactSubObj=2', '3 elements'),
    (COMPACT.replace('PDOMapping=1', 'PDOMapping=0'), 'PDOMapping=0', 'PDOMapping=1'),
    (ARRAY + element(1) + element(2, mapping='PDOMapping=0\n') + element(3), 'PDOMapping=0', '[2000sub2]'),
    (ARRAY + element(1) + element(2, access='wo') + element(3), 'AccessType=wo', '[2000sub2]'),
    (ARRAY + element(1, access='rww') + element(2) + element(3), 'AccessType=rww', 'rwr')])
def test_taxels_that_no_tpdo_can_map_are_refused_by_section_and_line(tmp_path, taxels, at, says):
    with pytest.raises(ConfigurationError) as refused:
        check_taxels(tmp_path, taxels)
    lines = (tmp_path / 'device.eds').read_text().splitlines()
    assert refused.value.where.endswith(f'line {len(lines) - lines[::-1].index(at)}') and says in str(refused.value)
