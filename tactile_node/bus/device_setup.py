"""Find, identify and configure one CANopen device, so that it is ready for NMT start (CiA 301, CiA 302-2)."""

import logging
import time
from collections.abc import Callable, Collection
from contextlib import suppress
from typing import NamedTuple, NoReturn, TypeVar

from canopen import SdoAbortedError, SdoCommunicationError
from canopen.objectdictionary import ODVariable
from canopen.sdo import SdoClient

from tactile_node.bus.domain_polling import check_domain
from tactile_node.bus.log_throttle import LogThrottle
from tactile_node.bus.own_sdo import explain_refusal
from tactile_node.cia301 import objects
from tactile_node.cia301.heartbeat import Heartbeats
from tactile_node.errors import BusError, DeviceAbsentError, DeviceError, InterruptedSetupError, UnverifiedDeviceError
from tactile_node.skin.eds_rules import Identity, identity_of
from tactile_node.skin.layout import TpdoLayout
from tactile_node.skin.pads import CanopenNode

logger = logging.getLogger(__name__)

#: Size [bytes] and name of each sub-index in a communication record that determines when a TPDO is sent.
SENDING_TIMES = {objects.TRANSMISSION_TYPE: (1, 'transmission type'), objects.INHIBIT_TIME: (2, 'inhibit time'),
                 objects.EVENT_TIMER: (2, 'event timer')}

#: Remedies for a device that does not answer by SDO, with and without a heartbeat during the wait.
ALIVE_REMEDY = ('Its heartbeat arrives, so power and wiring work. This machine may be too slow to receive the answer: '
                'reduce its load. Otherwise, end other programs that send SDO requests to the device, or restart the '
                'device.')
ABSENT_REMEDY = 'Check power, wiring, termination, bit rate and node-ID. `tactile scan` lists the nodes of a bus.'

Answer = TypeVar('Answer')
MappingEntries = list[int] | None  # entries of a mapping record; None for an MPDO with source addressing


class DeviceAsSet(NamedTuple):
    """Settings of a device after its configuration, as read back from the device."""

    by_block: bool = False  #: True if the device sends its DOMAIN by block upload
    heartbeat_ms: int | None = None  #: heartbeat time [ms]; 0 if the device sends no heartbeat; None if unknown
    serial_number: int | None = None  #: object 0x1018, sub-index 4; None if the device does not have it

    @property
    def heartbeat_time(self) -> float | None:
        """Heartbeat time [s]; 0 if the device sends no heartbeat; None if unknown."""
        return None if self.heartbeat_ms is None else 1e-3 * self.heartbeat_ms


class DeviceSetup:
    """Configures the device of one node.

    Parameters
    ----------
    sdo : SdoClient
        SDO client of the device.
    node : CanopenNode
        Node with its EDS and its layout.
    heartbeats : Heartbeats
        Source of the heartbeats received on the bus.
    retries : int
        Number of times an unanswered request is repeated.
    is_interrupted : callable
        Function that is called before each request. If the function returns True, the configuration ends with
        InterruptedSetupError.
    """

    def __init__(self, sdo: SdoClient, node: CanopenNode, heartbeats: Heartbeats, retries: int,
                 is_interrupted: Callable[[], bool] = lambda: False):
        self._sdo = sdo
        self._node = node
        self._label = node.label
        self._tries = 1 + retries
        self._is_interrupted = is_interrupted
        self._heartbeats = heartbeats
        self._replaced: list[tuple[int, int, int, int]] = []  # index, sub-index, previous value, number of bytes

    def run(self, boot_timeout: float, heartbeat_ms: int) -> DeviceAsSet:
        """Find the device, check its identity and configure it.

        If the configuration fails, the previous TPDO settings are restored.

        Parameters
        ----------
        boot_timeout : float
            Time allowed for the first answer [s].
        heartbeat_ms : int
            Heartbeat time to set on the device [ms].

        Returns
        -------
        DeviceAsSet
            Present settings of the device.

        Raises
        ------
        DeviceAbsentError
            Raised if the device does not answer.
        DeviceError
            Raised if the device has a different identity or rejects the configuration.
        BusError
            Raised if a request cannot be sent.
        InterruptedSetupError
            Raised if the configuration was interrupted.
        """
        try:
            return self._run(boot_timeout, heartbeat_ms)
        except (DeviceError, InterruptedSetupError):
            self._restore()
            raise

    def _run(self, boot_timeout: float, heartbeat_ms: int) -> DeviceAsSet:
        self._wait_for_device(boot_timeout)
        self._check_identity()
        serial = self._read_if_any(objects.IDENTITY, 4)
        if self._node.layout.needs_sync:
            self._set_sync(self._node.layout.sync_cob_id)
        heartbeat = self._set_heartbeat(heartbeat_ms)
        if self._node.layout.domain is not None:
            return DeviceAsSet(check_domain(self._sdo, self._node.layout.domain, self._label), heartbeat, serial)
        # a multiplexed TPDO appears several times in the layout
        tpdos = {tpdo.number: tpdo for tpdo in self._node.layout.tpdos}
        self._disable_rivals()
        self._report_fixed_times(tpdos)
        written = sum(self._configure(tpdo) for tpdo in tpdos.values())
        logger.info('%s: %d TPDOs ready, %d of them newly written.', self._label, len(tpdos), written)
        return DeviceAsSet(heartbeat_ms=heartbeat, serial_number=serial)

    def _wait_for_device(self, timeout: float) -> None:
        begun, throttle = time.monotonic(), LogThrottle()
        while True:
            self._check_interrupt()
            try:
                self._sdo.upload(objects.IDENTITY, 1)
                return
            except SdoAbortedError:  # an abort is also an answer; the next step reports a missing object
                return
            except SdoCommunicationError:
                now = time.monotonic()
            heard = self._heartbeats.of(self._node.node_id).heard
            is_alive = heard is not None and heard >= begun
            absent = DeviceAbsentError(self._label, expected=f'an answer by SDO within {timeout:g} s',
                                       got=self._silence(), remedy=ALIVE_REMEDY if is_alive else ABSENT_REMEDY)
            if now - begun >= timeout:
                raise absent
            if throttle.is_due(self._label, now):
                logger.info('Waiting for %s to answer by SDO: %s so far.', self._label, absent.got,
                            extra={'fact': absent})

    def _silence(self) -> str:
        state = self._heartbeats.of(self._node.node_id).state
        if state is not None:
            return f'only its heartbeat ({objects.state_name(state)})'
        others = ', '.join(map(str, self._heartbeats.nodes))
        return f'no answer, but heartbeats of node {others}' if others else 'no answer'

    def _check_identity(self) -> None:
        ours = identity_of(self._node.dictionary, self._node.eds)
        theirs = Identity(*(self._read_if_any(objects.IDENTITY, sub) for sub in (1, 2, 3)))
        if not ours.accepts(theirs):
            raise UnverifiedDeviceError(f'{self._label}, object 0x{objects.IDENTITY:04X}', got=str(theirs),
                                        expected=f'{ours} as in {self._node.eds}',
                                        remedy='Check the node-ID, or use the EDS and layout of this device.')
        if ours.not_given:
            logger.warning('%s: the EDS %s gives no %s in object 0x%04X, so the driver accepts any value.', self._label,
                           self._node.eds, ', '.join(ours.not_given), objects.IDENTITY)
        logger.info('%s was found: %s.', self._label, theirs)

    def _set_sync(self, wanted: int) -> None:
        """Set the COB-ID of SYNC, and keep bits 30 and 31 of the object, which do not belong to the COB-ID.

        A device that produces SYNC does not allow its COB-ID to be changed, so a different COB-ID is an error.
        """
        if objects.COB_ID_SYNC not in self._node.dictionary:
            logger.info('%s: the EDS has no object 0x%04X, so the driver keeps the SYNC COB-ID.', self._label,
                        objects.COB_ID_SYNC)
            return
        now = self._read_if_any(objects.COB_ID_SYNC, 0)
        if now is not None and now & objects.SYNC_ID_MASK == wanted:
            return
        if now is not None and now & objects.PRODUCES_SYNC:
            raise DeviceError(f'{self._label}, object 0x{objects.COB_ID_SYNC:04X}',
                              expected=f'SYNC COB-ID 0x{wanted:03X}',
                              got=f'0x{now & objects.SYNC_ID_MASK:03X}, on which this device itself produces SYNC',
                              remedy='Set sync_cob_id in the layout to this COB-ID, or stop the device from producing '
                              'SYNC.')
        self._write(objects.COB_ID_SYNC, 0, (now or 0) & ~objects.SYNC_ID_MASK | wanted, 4, was=now)

    def _set_heartbeat(self, wanted: int) -> int | None:
        """Set the heartbeat time [ms]. Return the heartbeat time that the device now uses, or None if it is unknown."""
        now = self._read_if_any(objects.PRODUCER_HEARTBEAT_TIME, 0)
        if now != wanted and objects.PRODUCER_HEARTBEAT_TIME in self._node.dictionary:
            with suppress(SdoAbortedError):
                self._download(objects.PRODUCER_HEARTBEAT_TIME, 0, wanted.to_bytes(2, 'little'))
            now = self._read_if_any(objects.PRODUCER_HEARTBEAT_TIME, 0)
        if now != wanted:
            logger.info('%s: the heartbeat time cannot be set to %d ms; %s.', self._label, wanted,
                        'the present heartbeat time cannot be read' if now is None else
                        f'it stays at {now} ms' if now else 'the device sends no heartbeat')
        return now

    def _disable_rivals(self) -> None:
        """Disable foreign TPDOs that use one of the layout's COB-IDs.

        A foreign TPDO is not in the layout, and its data would be read as taxels. A device has foreign TPDOs if it was
        previously configured for another layout.
        """
        ours = {objects.TPDO_COMMUNICATION + tpdo.number - 1 for tpdo in self._node.layout.tpdos}
        cob_ids = {tpdo.cob_id.of(self._node.node_id) for tpdo in self._node.layout.tpdos}
        for index in objects.COMMUNICATION_RECORDS:
            if index in ours or index not in self._node.dictionary:
                continue
            current = self._read_if_any(index, 1)
            if current is None or current & ~objects.NO_RTR not in cob_ids:
                continue
            number = index - objects.TPDO_COMMUNICATION + 1
            self._write(index, 1, current | objects.DISABLED, 4, was=current)
            if not (now := self._read(index, 1)) & objects.DISABLED:
                self._refuse_other_value(f'0x{index:04X} sub 1 (COB-ID of TPDO {number})',
                                         f'0x{current | objects.DISABLED:08X}', f'0x{now:08X}')
            logger.warning('%s: TPDO %d is not in the layout and was disabled, because it used COB-ID 0x%03X of the '
                           'layout.',
                           self._label, number, current & objects.ID_MASK)

    def _configure(self, tpdo: TpdoLayout) -> bool:
        """Configure the device to send ``tpdo`` as the layout specifies. Return True if anything had to be written."""
        communication, mapping = objects.TPDO_COMMUNICATION + tpdo.number - 1, objects.TPDO_MAPPING + tpdo.number - 1
        entries = None if tpdo.is_mpdo else [mapped.entry for mapped in tpdo.mapping]
        transmission = self._transmission(tpdo, communication)
        current, mapped = self._read(communication, 1), self._mapping(mapping)
        wanted = tpdo.cob_id.of(self._node.node_id) | current & objects.NO_RTR
        times = {sub: self._read(communication, sub) for sub in transmission}
        if (current, mapped, times) == (wanted, entries, transmission):
            return False
        disabled = current | objects.DISABLED  # CiA 301 allows changes only while the PDO is disabled
        try:
            self._write(communication, 1, disabled, 4, was=current)
            for sub, value in transmission.items():
                self._write(communication, sub, value, SENDING_TIMES[sub][0], was=times[sub])
            if mapped != entries:
                self._write_mapping(mapping, entries, was=mapped)
            self._write(communication, 1, wanted, 4, was=disabled)
            self._verify(tpdo, communication, wanted, transmission)
        except DeviceError as error:
            if mapped == entries or isinstance(error, DeviceAbsentError):
                raise
            raise UnverifiedDeviceError(error.where, expected=error.expected, got=error.got,
                                        remedy=error.remedy) from error
        return True

    def _transmission(self, tpdo: TpdoLayout, index: int) -> dict[int, int]:
        """Return the values to write, by sub-index.

        The values are the transmission type and, without SYNC, the times that the EDS lists.
        """
        event = self._node.layout.event_driven
        if event is None:
            return {objects.TRANSMISSION_TYPE: objects.MANUFACTURER_EVENT if tpdo.is_mpdo else objects.EVERY_SYNC}
        times = {sub: value for sub, value in event.times.items() if self._is_listed(index, sub)}
        return {objects.TRANSMISSION_TYPE: event.transmission_type, **times}

    def _is_listed(self, index: int, sub: int) -> bool:
        record = self._node.dictionary[index]
        return not isinstance(record, ODVariable) and sub in record.subindices

    def _report_fixed_times(self, tpdos: Collection[int]) -> None:
        """Log the times that the layout specifies for ``tpdos`` but the EDS does not list."""
        event = self._node.layout.event_driven
        for sub, value in () if event is None else event.times.items():
            fixed = [number for number in tpdos if not self._is_listed(objects.TPDO_COMMUNICATION + number - 1, sub)]
            if value and fixed:
                logger.warning('%s: the EDS has no %s (sub-index %d) for TPDO %s, so the driver does not set it.',
                               self._label, SENDING_TIMES[sub][1], sub, ', '.join(map(str, fixed)))

    def _mapping(self, index: int) -> MappingEntries:
        count = self._read(index, 0)
        return None if count == objects.SAM_MPDO else [self._read(index, sub) for sub in range(1, count + 1)]

    def _write_mapping(self, index: int, entries: MappingEntries, was: MappingEntries) -> None:
        self._write(index, 0, 0, 1, was=_count(was))
        for sub, entry in enumerate(entries or [], 1):
            self._write(index, sub, entry, 4, was=dict(enumerate(was or [], 1)).get(sub))
        self._write(index, 0, _count(entries), 1, was=0)
        if (now := self._mapping(index)) != entries:
            self._refuse_other_value(f'0x{index:04X}', _mapping_text(entries), _mapping_text(now))

    def _verify(self, tpdo: TpdoLayout, index: int, wanted: int, transmission: dict[int, int]) -> None:
        for sub, value in transmission.items():
            if (now := self._read(index, sub)) != value:
                self._refuse_other_value(f'0x{index:04X} sub {sub} ({SENDING_TIMES[sub][1]} of TPDO {tpdo.number})',
                                         f'0x{value:02X}', f'0x{now:02X}')
        now = self._read(index, 1)
        if now & (objects.DISABLED | objects.ID_MASK) != wanted & objects.ID_MASK:
            self._refuse_other_value(f'0x{index:04X} sub 1 (COB-ID of TPDO {tpdo.number})', f'0x{wanted:08X}',
                                     f'0x{now:08X}')

    def _refuse_other_value(self, what: str, expected: str, got: str) -> NoReturn:
        raise DeviceError(f'{self._label}, {what}', expected=f'{expected}, as just written',
                          got=f'{got} read back',
                          remedy='Adapt the layout to the device, because the device does not accept this value.')

    def _read(self, index: int, sub: int) -> int:
        """Return the value of an object as an unsigned number."""
        with explain_refusal(self._where(index, sub), 'be read'):
            return self._upload(index, sub)

    def _read_if_any(self, index: int, sub: int) -> int | None:
        """Return the value of an object as an unsigned number, or None if the device aborts the request."""
        with suppress(SdoAbortedError):
            return self._upload(index, sub)
        return None

    def _write(self, index: int, sub: int, value: int, size: int, was: int | None) -> None:
        """Write an unsigned number, and save the previous value ``was``, if known, for ``_restore``."""
        with explain_refusal(self._where(index, sub), f'be set to 0x{value:X}'):
            self._download(index, sub, value.to_bytes(size, 'little'))
        if was is not None:
            self._replaced.append((index, sub, was, size))

    def _restore(self) -> None:
        """Write the previous values back in reverse order, because CiA 301 allows each write only in that order."""
        for index, sub, value, size in reversed(self._replaced):
            try:
                self._sdo.download(index, sub, value.to_bytes(size, 'little'))
            except (SdoAbortedError, SdoCommunicationError, BusError) as error:
                logger.error('%s cannot be restored to 0x%X: %s. Cycle the power of the device.',
                             self._where(index, sub), value, error, extra={'fact': (index, sub)})
                return

    def _upload(self, index: int, sub: int) -> int:
        return int.from_bytes(self._retried('read', index, sub, lambda: self._sdo.upload(index, sub)), 'little')

    def _download(self, index: int, sub: int, data: bytes) -> None:
        self._retried('write', index, sub, lambda: self._sdo.download(index, sub, data))

    def _retried(self, verb: str, index: int, sub: int, request: Callable[[], Answer]) -> Answer:
        """Send a request, and repeat it while the device does not answer.

        Raise DeviceAbsentError after the last attempt.
        """
        silence: SdoCommunicationError | None = None
        for _ in range(self._tries):
            self._check_interrupt()
            try:
                return request()
            except SdoCommunicationError as error:
                silence = error
        timeout = self._tries * self._sdo.RESPONSE_TIMEOUT
        raise DeviceAbsentError(self._where(index, sub), got=str(silence),
                                expected=f'an answer to a {verb} within {timeout:g} s',
                                remedy='Check the wiring and the power of the device; a slow device needs a larger '
                                'sdo_timeout.') from silence

    def _check_interrupt(self) -> None:
        if self._is_interrupted():
            raise InterruptedSetupError(self._label, expected='to finish its configuration',
                                        got='a request to stop the driver', remedy='Start the driver again.')

    def _where(self, index: int, sub: int) -> str:
        return f'{self._label}, object 0x{index:04X} sub {sub}'


def _count(entries: MappingEntries) -> int:
    """Return the value of sub-index 0 for a mapping record with the given entries."""
    return objects.SAM_MPDO if entries is None else len(entries)


def _mapping_text(entries: MappingEntries) -> str:
    return 'an MPDO with source addressing' if entries is None else ' '.join(f'{entry:08X}' for entry in entries)
