"""Convert object values to and from text, and find objects in an EDS by name."""

from canopen import ObjectDictionary
from canopen.objectdictionary import ODVariable, datatypes

from tactile_node.cia301.objects import ObjectAddress
from tactile_node.skin.layout import raw_range

#: data types by their names on the command line (CiA 301, 7.4.7), where hex means bytes in transmission order
TYPES = {'bool': datatypes.BOOLEAN, 'str': datatypes.VISIBLE_STRING, 'hex': datatypes.DOMAIN,
         **{f'u{bits}': getattr(datatypes, f'UNSIGNED{bits}') for bits in (8, 16, 24, 32, 40, 48, 56, 64)},
         **{f'i{bits}': getattr(datatypes, f'INTEGER{bits}') for bits in (8, 16, 24, 32, 40, 48, 56, 64)},
         'f32': datatypes.REAL32, 'f64': datatypes.REAL64}
_NAMES = {number: name for name, number in TYPES.items()}

Value = int | float | str


class WrongValueError(ValueError):
    """Raised if text or bytes are not a valid value of a type. ``expected`` describes a valid value."""

    def __init__(self, expected: str):
        super().__init__(expected)
        self.expected = expected


def type_name(data_type: int | None) -> str:
    """Return the name of a data type in TYPES, or 'hex' for any other type.

    >>> type_name(0x0006), type_name(0x000F)
    ('u16', 'hex')
    """
    return _NAMES.get(data_type, 'hex') if data_type is not None else 'hex'


def encode_value(name: str, text: str) -> bytes:
    """Encode a value as bytes for an SDO transfer. Raises WrongValueError.

    Parameters
    ----------
    name
        Name of the type in TYPES.
    text
        Value as text.

    Examples
    --------

    >>> encode_value('u16', '0x64'), encode_value('i8', '-1'), encode_value('hex', 'DE ad')
    (b'd\\x00', b'\\xff', b'\\xde\\xad')
    """
    variable = _variable(name)
    if not text.strip():  # canopen would send an empty value
        raise WrongValueError(_expected(name))
    try:
        if name == 'hex':
            return bytes.fromhex(text)
        if name == 'str':
            return text.encode('ascii')
        if name == 'bool':
            return bytes(variable.encode_raw({'0': False, '1': True}[text]))
        return bytes(variable.encode_raw(float(text) if name in ('f32', 'f64') else int(text, 0)))
    except (KeyError, ValueError, OverflowError, UnicodeEncodeError) as error:
        raise WrongValueError(_expected(name)) from error


def decode_value(name: str, data: bytes) -> Value:
    """Decode bytes from an SDO transfer. Raises WrongValueError.

    Parameters
    ----------
    name
        Name of the type in TYPES.
    data
        Bytes.

    Examples
    --------

    >>> decode_value('i16', bytes.fromhex('FEFF')), decode_value('hex', bytes.fromhex('0100'))
    (-2, '0100')
    """
    if name == 'hex':
        return data.hex()
    if name == 'str':
        return _text(data.rstrip(b'\0'))
    variable = _variable(name)
    if len(data) != len(variable) // 8:
        raise WrongValueError(_expected(name))
    value = variable.decode_raw(data)
    return value if isinstance(value, float) else int(value)


def find_named(dictionary: ObjectDictionary, name: str) -> list[ObjectAddress]:
    """Return the addresses of all values with a name such as 'Identity.Vendor-ID' or 'Vendor-ID'. Case is ignored."""
    wanted = name.strip().lower()
    return [ObjectAddress(variable.index, variable.subindex) for variable in _variables(dictionary)
            if wanted in (variable.qualname.lower(), variable.name.lower())]


def find_declared(dictionary: ObjectDictionary, address: ObjectAddress) -> ODVariable | None:
    """Return the declaration of a value in an EDS, or None if the EDS does not declare the value."""
    return next((variable for variable in _variables(dictionary)
                 if ObjectAddress(variable.index, variable.subindex) == address), None)


def _variables(dictionary: ObjectDictionary) -> list[ODVariable]:
    found: list[ODVariable] = []
    for entry in dictionary.values():
        found += [entry] if isinstance(entry, ODVariable) else entry.subindices.values()
    return found


def _variable(name: str) -> ODVariable:
    variable = ODVariable(name, 0)
    variable.data_type = TYPES[name]
    return variable


def _expected(name: str) -> str:
    if name in ('f32', 'f64'):
        return f'a number of {int(name[1:]) // 8} bytes'
    if name[0] in 'ui':
        bits = int(name[1:])
        low, high = raw_range(bits, name[0] == 'i')
        return f'a whole number {low}..{high}, {bits // 8} byte{"s" * (bits > 8)}'
    return {'bool': '0 or 1, 1 byte', 'str': 'ASCII text, not empty',
            'hex': 'bytes as hexadecimal digits such as "6400"'}[name]


def _text(data: bytes) -> str:
    """Decode text. CiA 301 allows only ASCII, but some devices send UTF-8 or a national code page."""
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode('latin-1')
