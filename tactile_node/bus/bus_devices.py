"""The CANopen devices of one bus, by NMT and SDO: configured, started, stopped, zeroed."""

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, suppress

from canopen import ObjectDictionary, SdoAbortedError, SdoCommunicationError
from canopen.objectdictionary import ODVariable
from canopen.sdo import SdoClient

from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.bus_network import BusNetwork
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.device_setup import DeviceAsSet, DeviceSetup
from tactile_node.bus.own_sdo import OwnSdoClient
from tactile_node.cia301 import objects
from tactile_node.cia301.emergency import DeviceErrors
from tactile_node.cia301.objects import ZERO_SIGNATURE
from tactile_node.errors import BusError, DeviceError, HalfZeroedError, TwoDevicesError
from tactile_node.skin.pads import CanopenNode


def auto_zero(sdo: SdoClient, dictionary: ObjectDictionary, label: str) -> int:
    """Zero every channel that the EDS lists; how many.

    Raises DeviceError where nothing was zeroed, HalfZeroedError where some channels were, or where the device has not
    answered.
    """
    where = f'{label}, object 0x{objects.AUTO_ZERO:04X}'
    entry = dictionary[objects.AUTO_ZERO] if objects.AUTO_ZERO in dictionary else None
    subs = [0] if isinstance(entry, ODVariable) else [sub for sub in entry or () if sub]
    if not subs:
        raise DeviceError(where, expected="the device's auto-zero (CiA 404) in its EDS", got='no such object',
                          remedy='Tare without on_device: then the driver takes the zero off.')
    for sub in subs:
        try:
            sdo.download(objects.AUTO_ZERO, sub, ZERO_SIGNATURE)
        except (SdoAbortedError, SdoCommunicationError, BusError) as error:
            done = subs.index(sub)
            kind = HalfZeroedError if done or not isinstance(error, SdoAbortedError) else DeviceError
            raise kind(f'{where} sub {sub}', expected='that it takes "zero"', got=str(error),
                       remedy=f'{done} of {len(subs)} channels are zeroed. See the manual of the device, or tare '
                              'without on_device.') from error
    return len(subs)


def read_errors(sdo: SdoClient) -> DeviceErrors:
    """Return them as far as the device answers, the newest four: a device may keep 254. Raises BusError."""
    def read(index: int, sub: int) -> int | None:
        with suppress(SdoAbortedError):  # 0x1003 is optional
            return int.from_bytes(sdo.upload(index, sub), 'little')
        return None
    register = None
    field: list[int] = []
    with suppress(SdoCommunicationError):
        register = read(objects.ERROR_REGISTER, 0)
        for sub in range(1, min(read(objects.ERROR_FIELD, 0) or 0, 4) + 1):
            field += [entry for entry in (read(objects.ERROR_FIELD, sub),) if entry is not None]
    return DeviceErrors(register, tuple(field))


START_PERIOD = 1.3  # s between two NMT starts of a node that does not become OPERATIONAL


class BusDevices:
    """The devices of ``nodes``; ``network()`` is the open bus, or raises BusError."""

    def __init__(self, settings: BusSettings, nodes: Sequence[CanopenNode], monitor: BusMonitor,
                 network: Callable[[], BusNetwork]):
        self._settings = settings
        self._nodes = nodes
        self._monitor = monitor
        self._network = network
        self._interrupts = 0

    def sdo_client(self, node: CanopenNode) -> AbstractContextManager[OwnSdoClient]:
        return self._network().sdo_client(node.node_id, node.dictionary, self._settings.sdo_timeout)

    def command(self, command: objects.NmtCommand, node: CanopenNode) -> None:
        self._network().send_message(objects.NMT, bytes([command, node.node_id]))

    def configure(self, node: CanopenNode, boot_timeout: float, pause: bool) -> DeviceAsSet:
        """Configure one, found within ``boot_timeout`` [s]; without ``pause`` while it sends.

        Raises DeviceError, BusError; TwoDevicesError where two devices answer as this node.
        """
        interrupts = self._interrupts
        foreign_requests = self._monitor.foreign_requests[node.node_id]
        if pause:
            self.command(objects.NmtCommand.ENTER_PRE_OPERATIONAL, node)
        with self.sdo_client(node) as sdo:
            setup = DeviceSetup(sdo, node, self._monitor.heartbeats, self._settings.sdo_retries,
                                is_interrupted=lambda: self._interrupts != interrupts)
            as_set = setup.run(boot_timeout, self._settings.heartbeat_ms)
            is_alone = self._monitor.foreign_requests[node.node_id] == foreign_requests  # no other client is answered
            if is_alone and 2 * sdo.doubled > sdo.requests:
                raise TwoDevicesError(node.label, expected='one device with this node-ID', remedy='Switch one of them '
                                      'off, and set another node-ID on it.',
                                      got=f'a second answer to {sdo.doubled} of {sdo.requests} requests')
        return as_set

    def interrupt(self) -> None:
        """End the configurations under way; from any thread, returns at once."""
        self._interrupts += 1

    def read_errors(self, node: CanopenNode) -> DeviceErrors:
        """Read what a device lists as its errors. Raises BusError."""
        with self.sdo_client(node) as sdo:
            return read_errors(sdo)

    def auto_zero(self, pad: str) -> int:
        """Let the pad's devices zero themselves; how many channels. Raises DeviceError, BusError, HalfZeroedError."""
        zeroed = 0
        for node in self._nodes:
            if node.pad == pad:
                try:
                    with self.sdo_client(node) as sdo:
                        zeroed += auto_zero(sdo, node.dictionary, node.label)
                except (DeviceError, BusError) as error:
                    if not zeroed:
                        raise
                    raise HalfZeroedError(error.where, expected=error.expected, got=error.got, remedy=error.remedy
                                          + f' {zeroed} channels of other nodes are zeroed.') from error
        return zeroed

    def confirm_operational(self, node: CanopenNode, since: float) -> None:
        """Wait for it as long as for its first answer; NMT start is sent again and again, for it may be lost.

        Raises DeviceError with what the device lists as its errors, BusError.
        """
        end = time.monotonic() + max(self._settings.boot_timeout, START_PERIOD) + 3e-3 * self._settings.heartbeat_ms
        while time.monotonic() < end:
            if self._monitor.heartbeats.wait_for(node.node_id, objects.NmtState.OPERATIONAL, since, START_PERIOD):
                return
            self.command(objects.NmtCommand.START, node)
        state = self._monitor.heartbeats.of(node.node_id).state
        heard = 'no heartbeat' if state is None else f'its heartbeat ({objects.state_name(state)})'
        raise DeviceError(node.label, expected='OPERATIONAL after NMT start', got=f'{heard}; {self.read_errors(node)}',
                          remedy='See its manual: a device with an error may refuse to start.')
