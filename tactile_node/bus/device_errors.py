"""Reads what a device lists as its errors: error register and pre-defined error field (CiA 301, 7.5.2.2, 7.5.2.4)."""

from canopen import SdoAbortedError, SdoCommunicationError
from canopen.sdo import SdoClient

from tactile_node.cia301.emergency import DeviceErrors
from tactile_node.cia301.objects import ERROR_FIELD, ERROR_REGISTER

MOST = 4  # entries read, the newest ones; a device may keep 254


def read_errors(sdo: SdoClient) -> DeviceErrors:
    """Return them as far as the device answers. Raises BusError."""
    register = None
    field: list[int] = []
    try:
        register = _number(sdo, ERROR_REGISTER, 0)
        for sub in range(1, min(_number(sdo, ERROR_FIELD, 0) or 0, MOST) + 1):
            field += [entry for entry in (_number(sdo, ERROR_FIELD, sub),) if entry is not None]
    except SdoCommunicationError:
        pass
    return DeviceErrors(register, tuple(field))


def _number(sdo: SdoClient, index: int, sub: int) -> int | None:
    """None where the device refuses it: 0x1003 is optional."""
    try:
        return int.from_bytes(sdo.upload(index, sub), 'little')
    except SdoAbortedError:
        return None
