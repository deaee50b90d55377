"""Reads and writes one object of a device by SDO; what the device refuses is a DeviceError."""

from collections.abc import Iterator
from contextlib import contextmanager

from canopen import SdoAbortedError, SdoCommunicationError
from canopen.sdo import SdoClient

from tactile_node.cia301.object_address import ObjectAddress
from tactile_node.cia301.objects import RESTORE_PARAMETERS, STORE_PARAMETERS
from tactile_node.errors import DeviceAbsentError, DeviceError

SAVE, LOAD = b'save', b'load'  #: signatures of 0x1010 and 0x1011 (CiA 301, 7.5.2.13 and 7.5.2.14)
ALL_PARAMETERS = 1             #: their sub-index that stands for all


def read_object(sdo: SdoClient, address: ObjectAddress) -> bytes:
    """Return the bytes of one object. Raises DeviceError."""
    with _refusals(sdo, address, 'be read'):
        with sdo.open(address.index, address.sub, 'rb', buffering=0) as upload:
            announced, data = upload.size, bytes(upload.read())
    if announced is not None and announced != len(data):
        raise DeviceError(_where(sdo, address), expected=f'{announced} bytes, as the device announces',
                          got=f'{len(data)} bytes', remedy='Read it again; another SDO client may have interfered.')
    return data


def write_object(sdo: SdoClient, address: ObjectAddress, data: bytes) -> None:
    """Write ``data``. Raises DeviceError where the device does not confirm it."""
    with _refusals(sdo, address, f'be set to the bytes {data[:8].hex()}{"..." if len(data) > 8 else ""}'):
        sdo.download(address.index, address.sub, data)


def store_parameters(sdo: SdoClient, sub: int = ALL_PARAMETERS) -> None:
    """Make the device keep its parameters over a power cycle. Raises DeviceError."""
    write_object(sdo, ObjectAddress(STORE_PARAMETERS, sub), SAVE)


def restore_parameters(sdo: SdoClient, sub: int = ALL_PARAMETERS) -> None:
    """Make the device take its maker's parameters at its next reset. Raises DeviceError."""
    write_object(sdo, ObjectAddress(RESTORE_PARAMETERS, sub), LOAD)


@contextmanager
def _refusals(sdo: SdoClient, address: ObjectAddress, what: str) -> Iterator[None]:
    try:
        yield
    except SdoAbortedError as error:
        raise DeviceError(_where(sdo, address), expected=f'that it can {what}', got=f'SDO abort: {error}',
                          remedy="Compare with the device's manual and EDS.") from error
    except SdoCommunicationError as error:
        raise DeviceAbsentError(_where(sdo, address), expected=f'an answer by SDO within {sdo.RESPONSE_TIMEOUT:g} s',
                                got=str(error), remedy='Check power, wiring, bit rate and node-ID; a slow device '
                                'needs a larger --timeout.') from error


def _where(sdo: SdoClient, address: ObjectAddress) -> str:
    return f'node {sdo.rx_cobid & 0x7F}, object {address}'
