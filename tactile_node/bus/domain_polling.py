"""Poll the DOMAIN of a pad by SDO.

A poll only causes the device to send its data. The assembler reads the data from the frames on the bus.
"""

import logging
import time
from collections.abc import Callable
from contextlib import AbstractContextManager

from canopen import SdoAbortedError, SdoCommunicationError
from canopen.sdo import SdoClient

from tactile_node.assembly.health import BusFault
from tactile_node.bus.log_throttle import LogThrottle
from tactile_node.bus.pacer import Pacer
from tactile_node.errors import BusError, DeviceError
from tactile_node.skin.layout import DomainLayout

logger = logging.getLogger(__name__)


def upload(sdo: SdoClient, domain: DomainLayout, by_block: bool) -> bytes:
    """Read a DOMAIN.

    Parameters
    ----------
    sdo : SdoClient
        SDO client of the device.
    domain : DomainLayout
        Index, sub-index and length of the object.
    by_block : bool
        True for a block upload, False for a segmented upload.

    Raises
    ------
    BusError
        Raised if a request cannot be sent.
    canopen.SdoAbortedError
        Raised if the device aborts the upload.
    canopen.SdoCommunicationError
        Raised if the device does not answer, or if frames are missing or do not belong to the upload.
    """
    try:
        if not by_block:
            return sdo.upload(domain.index, domain.subindex)
        with sdo.open(domain.index, domain.subindex, 'rb', block_transfer=True) as stream:
            return stream.read()
    except (SdoAbortedError, SdoCommunicationError, BusError):
        raise
    # If the last frame is lost or a foreign frame arrives in between, canopen raises AttributeError or another
    # exception.
    except Exception as error:
        raise SdoCommunicationError(f'Upload failed: {type(error).__name__}: {error}') from error


def check_domain(sdo: SdoClient, domain: DomainLayout, label: str) -> bool:
    """Read a DOMAIN once, to check its length and to find out which kind of upload the device supports.

    The arguments ``sdo`` and ``domain`` are those of `upload`. The name of the node in messages is ``label``.

    Returns
    -------
    bool
        True if the device sends the object by block upload, False if it uses segmented upload.

    Raises
    ------
    DeviceError
        Raised if the object cannot be read or its length differs from the layout.
    """
    where = f'{label}, object 0x{domain.index:04X} sub {domain.subindex}'
    read, is_block = None, False
    for by_block in (True, False):
        try:
            read, is_block = upload(sdo, domain, by_block), by_block
            break
        except (SdoAbortedError, SdoCommunicationError) as error:
            reason = error
    if read is None:
        raise DeviceError(where, expected='a DOMAIN that can be read', got=str(reason),
                          remedy='Compare "domain" in the layout with the manual of the device and its EDS.')
    if len(read) != domain.length:
        raise DeviceError(where, expected=f'{domain.length} bytes, as in the layout', got=f'{len(read)} bytes',
                          remedy='Correct "bytes" in the layout, or use the layout of this device.')
    logger.info('%s: the driver reads the taxels by %s SDO upload, %d bytes per frame.',
                label, 'block' if is_block else 'segmented', len(read))
    return is_block


class DomainPolling(Pacer):
    """Polls the DOMAIN of one node on a separate thread, from ``start`` to ``stop``.

    Failed polls are logged at increasing intervals. The assembler counts lost uploads.

    Parameters
    ----------
    domain : DomainLayout
        Object to poll.
    label : str
        Name of the node in log messages.
    period : float
        Time between two polls [s].
    open_sdo : callable
        Function that returns a context manager that yields the SDO client of the node.
    on_failure : callable
        Function that is called with a `BusFault` and the exception if a request cannot be sent or the thread fails.
    """

    def __init__(self, domain: DomainLayout, label: str, period: float,
                 open_sdo: Callable[[], AbstractContextManager[SdoClient]],
                 on_failure: Callable[[BusFault, Exception], None]):
        super().__init__(period, self._poll, 'poll', lambda error: on_failure(BusFault.INTERNAL_ERROR, error))
        self._domain = domain
        self._label = label
        self._open_sdo = open_sdo
        self._on_failure = on_failure
        self._throttle = LogThrottle()
        self.by_block = True  #: True for block uploads, False for segmented uploads

    def _poll(self) -> None:
        try:
            with self._open_sdo() as sdo:
                # Time after which a missing answer counts as lost [s]. The timeout is short so that a lost frame delays
                # only a few further polls.
                sdo.RESPONSE_TIMEOUT = 0.1
                upload(sdo, self._domain, self.by_block)
        except (SdoAbortedError, SdoCommunicationError) as error:
            if self._throttle.is_due(str(error), time.monotonic()):
                logger.error('%s: the taxels could not be read: %s', self._label, error, extra={'fact': error})
        except BusError as error:
            self._on_failure(BusFault.SENDING_FAILED, error)
