"""Reads and writes numbers in the object dictionary of one device; what it refuses becomes an error that names it."""

from collections.abc import Callable
from typing import NoReturn, TypeVar

from canopen import SdoAbortedError, SdoCommunicationError
from canopen.sdo import SdoClient

from tactile_node.errors import DeviceAbsentError, DeviceError, InterruptedSetupError

Answer = TypeVar('Answer')


class DeviceObjects:
    """The objects of the device ``label``; a request without an answer is repeated ``retries`` times.

    Raises DeviceError where the device refuses, DeviceAbsentError where it does not answer, BusError; and
    InterruptedSetupError in place of the next request when ``is_interrupted()``.
    """

    def __init__(self, sdo: SdoClient, label: str, retries: int, is_interrupted: Callable[[], bool]):
        self._sdo = sdo
        self._label = label
        self._tries = 1 + retries
        self._is_interrupted = is_interrupted

    def _read(self, index: int, sub: int) -> int:
        """Read an unsigned number."""
        try:
            return self._uploaded(index, sub)
        except SdoAbortedError as error:
            self._refuse('be read', index, sub, error)

    def _read_if_any(self, index: int, sub: int) -> int | None:
        """Read an unsigned number; None where the device refuses it."""
        try:
            return self._uploaded(index, sub)
        except SdoAbortedError:
            return None

    def _uploaded(self, index: int, sub: int) -> int:
        return int.from_bytes(self._retried('read', index, sub, lambda: self._sdo.upload(index, sub)), 'little')

    def _write(self, index: int, sub: int, value: int, size: int) -> None:
        try:
            self._download(index, sub, value.to_bytes(size, 'little'))
        except SdoAbortedError as error:
            self._refuse(f'be set to 0x{value:X}', index, sub, error)

    def _write_if_taken(self, index: int, sub: int, value: int, size: int) -> None:
        """Write a number; the device may refuse it."""
        try:
            self._download(index, sub, value.to_bytes(size, 'little'))
        except SdoAbortedError:
            pass

    def _download(self, index: int, sub: int, data: bytes) -> None:
        self._retried('write', index, sub, lambda: self._sdo.download(index, sub, data))

    def _retried(self, verb: str, index: int, sub: int, request: Callable[[], Answer]) -> Answer:
        """What ``request`` returns; it is repeated when there is no answer. Raises DeviceAbsentError."""
        silence: SdoCommunicationError | None = None
        for _ in range(self._tries):
            self._check_interrupt()
            try:
                return request()
            except SdoCommunicationError as error:
                silence = error
        timeout = self._tries * self._sdo.RESPONSE_TIMEOUT
        raise DeviceAbsentError(f'{self._label}, object 0x{index:04X} sub {sub}', got=str(silence),
                                expected=f'an answer to a {verb} within {timeout:g} s',
                                remedy='Check the wiring and whether the device is on; a slow one needs a larger '
                                'sdo_timeout.') from silence

    def _check_interrupt(self) -> None:
        if self._is_interrupted():
            raise InterruptedSetupError(self._label, expected='that it is configured', got='a driver that stops',
                                        remedy='Start the driver again.')

    def _refuse(self, what: str, index: int, sub: int, error: SdoAbortedError) -> NoReturn:
        raise DeviceError(f'{self._label}, object 0x{index:04X} sub {sub}', expected=f'that it can {what}',
                          got=f'SDO abort: {error}',
                          remedy="Compare the layout with the device's manual and EDS.") from error
