"""The device's own auto-zero (CiA 404, object 0x6125: write "zero")."""

from canopen import ObjectDictionary, SdoAbortedError, SdoCommunicationError
from canopen.objectdictionary import ODVariable
from canopen.sdo import SdoClient

from tactile_node.cia301.cia404 import AUTO_ZERO, ZERO_SIGNATURE
from tactile_node.errors import BusError, DeviceError, HalfZeroedError


def auto_zero(sdo: SdoClient, dictionary: ObjectDictionary, label: str) -> int:
    """Zero every channel that the EDS lists; how many.

    Raises DeviceError where nothing was zeroed, HalfZeroedError where some channels were, or where the device has not
    answered.
    """
    where = f'{label}, object 0x{AUTO_ZERO:04X}'
    entry = dictionary[AUTO_ZERO] if AUTO_ZERO in dictionary else None
    subs = [0] if isinstance(entry, ODVariable) else [sub for sub in entry or () if sub]
    if not subs:
        raise DeviceError(where, expected="the device's auto-zero (CiA 404) in its EDS", got='no such object',
                          remedy='Tare without on_device: then the driver takes the zero off.')
    for sub in subs:
        try:
            sdo.download(AUTO_ZERO, sub, ZERO_SIGNATURE)
        except (SdoAbortedError, SdoCommunicationError, BusError) as error:
            done = subs.index(sub)
            kind = HalfZeroedError if done or not isinstance(error, SdoAbortedError) else DeviceError
            raise kind(f'{where} sub {sub}', expected='that it takes "zero"', got=str(error),
                       remedy=f'{done} of {len(subs)} channels are zeroed. See the manual of the device, or tare '
                              'without on_device.') from error
    return len(subs)
