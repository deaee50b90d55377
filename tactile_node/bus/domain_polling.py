"""Polls a pad's DOMAIN by SDO. The assembler takes the data from the frames on the bus."""

import logging
import time
from collections.abc import Callable
from contextlib import AbstractContextManager

from canopen import SdoAbortedError, SdoCommunicationError
from canopen.sdo import SdoClient

from tactile_node.assembly.health import BusFault
from tactile_node.bus.message_pace import Reminder
from tactile_node.bus.threads import Pacer
from tactile_node.errors import BusError, DeviceError
from tactile_node.skin.layout import DomainLayout

logger = logging.getLogger(__name__)


def upload(sdo: SdoClient, domain: DomainLayout, by_block: bool) -> bytes:
    """Read the object. Raises BusError and canopen's SdoAbortedError and SdoCommunicationError."""
    try:
        if not by_block:
            return sdo.upload(domain.index, domain.subindex)
        with sdo.open(domain.index, domain.subindex, 'rb', block_transfer=True) as stream:
            return stream.read()
    except (SdoAbortedError, SdoCommunicationError, BusError):
        raise
    except Exception as error:  # canopen's streams over a lost last frame or a foreign one: AttributeError and others
        raise SdoCommunicationError(f'Upload failed: {type(error).__name__}: {error}') from error


def check_domain(sdo: SdoClient, domain: DomainLayout, label: str) -> bool:
    """Read the object once: whether the device sends it by block. Raises DeviceError when it cannot be used."""
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
    logger.info('%s: its taxels are read by %s SDO upload, %d bytes a frame.',
                label, 'block' if is_block else 'segmented', len(read))
    return is_block


class DomainPolling(Pacer):
    """Polls one node's DOMAIN every ``period`` [s] from ``start`` to ``stop``, on its own thread.

    ``open_sdo()`` is a context manager that gives the node's SDO client. Failed polls are logged now and
    then; the assembler counts the losses. A BusError goes to ``on_failure``.
    """

    def __init__(self, domain: DomainLayout, label: str, period: float,
                 open_sdo: Callable[[], AbstractContextManager[SdoClient]],
                 on_failure: Callable[[BusFault, Exception], None]):
        super().__init__(period, self._poll, 'poll', lambda error: on_failure(BusFault.INTERNAL_ERROR, error))
        self._domain = domain
        self._label = label
        self._open_sdo = open_sdo
        self._on_failure = on_failure
        self._reminder = Reminder()
        self.by_block = True  #: whether the device sends it by block

    def _poll(self) -> None:
        try:
            with self._open_sdo() as sdo:
                # s until a missing frame counts as lost: a poll must not outlast many periods
                sdo.RESPONSE_TIMEOUT = 0.1
                upload(sdo, self._domain, self.by_block)
        except (SdoAbortedError, SdoCommunicationError) as error:
            if self._reminder.is_due(str(error), time.monotonic()):
                logger.error('%s: its taxels could not be read: %s', self._label, error, extra={'fact': error})
        except BusError as error:
            self._on_failure(BusFault.SENDING_FAILED, error)
