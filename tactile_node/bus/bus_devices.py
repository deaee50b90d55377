"""Configure, start, stop and zero the CANopen devices of one bus. The module uses NMT commands and SDO requests."""

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
    """Zero every channel that the EDS of a device lists under the CiA 404 auto-zero object.

    Parameters
    ----------
    sdo : SdoClient
        SDO client of the device.
    dictionary : ObjectDictionary
        Object dictionary of the device, read from its EDS.
    label : str
        Name of the node in error messages.

    Returns
    -------
    int
        Number of channels zeroed.

    Raises
    ------
    DeviceError
        Raised if no channel was zeroed.
    HalfZeroedError
        Raised if some channels were zeroed before the device refused one, or if the device did not answer. A device
        that did not answer may or may not have zeroed the channel.
    """
    where = f'{label}, object 0x{objects.AUTO_ZERO:04X}'
    entry = dictionary[objects.AUTO_ZERO] if objects.AUTO_ZERO in dictionary else None
    subs = [0] if isinstance(entry, ODVariable) else [sub for sub in entry or () if sub]
    if not subs:
        raise DeviceError(where, expected="the device's auto-zero (CiA 404) in its EDS", got='no such object',
                          remedy='Tare without on_device, so that the driver subtracts the zero.')
    for sub in subs:
        try:
            sdo.download(objects.AUTO_ZERO, sub, ZERO_SIGNATURE)
        except (SdoAbortedError, SdoCommunicationError, BusError) as error:
            done = subs.index(sub)
            kind = HalfZeroedError if done or not isinstance(error, SdoAbortedError) else DeviceError
            raise kind(f'{where} sub {sub}', expected='a device that accepts the signature "zero"', got=str(error),
                       remedy=f'{done} of {len(subs)} channels are zeroed. See the manual of the device, or tare '
                              'without on_device.') from error
    return len(subs)


def read_errors(sdo: SdoClient) -> DeviceErrors:
    """Return the error register of a device and its four newest errors.

    Objects that the device does not report are missing from the result.

    A device may store up to 254 errors, so the driver reads only the newest four.

    Parameters
    ----------
    sdo : SdoClient
        SDO client of the device.

    Raises
    ------
    BusError
        Raised if a request cannot be sent.
    """
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


START_PERIOD = 1.3  #: Time between two NMT start commands to a node that has not become OPERATIONAL [s].


class BusDevices:
    """The CANopen devices of one bus.

    Parameters
    ----------
    settings : BusSettings
        Timeouts, retries and heartbeat time.
    nodes : sequence of CanopenNode
        Nodes of all pads on the bus.
    monitor : BusMonitor
        Monitor that receives the heartbeats of the nodes.
    network : callable
        Function that returns the open bus. The function raises BusError if the bus is not open.
    """

    def __init__(self, settings: BusSettings, nodes: Sequence[CanopenNode], monitor: BusMonitor,
                 network: Callable[[], BusNetwork]):
        self._settings = settings
        self._nodes = nodes
        self._monitor = monitor
        self._network = network
        self._interrupts = 0

    def sdo_client(self, node: CanopenNode) -> AbstractContextManager[OwnSdoClient]:
        """Return a context manager that yields the SDO client of ``node``."""
        return self._network().sdo_client(node.node_id, node.dictionary, self._settings.sdo_timeout)

    def command(self, command: objects.NmtCommand, node: CanopenNode) -> None:
        """Send an NMT command to one CANopen node. Raises BusError."""
        self._network().send_message(objects.NMT, bytes([command, node.node_id]))

    def configure(self, node: CanopenNode, boot_timeout: float, pause: bool) -> DeviceAsSet:
        """Configure one device; see `SkinBus.configure_node`. Raises InterruptedSetupError after ``interrupt``."""
        interrupts = self._interrupts
        foreign_requests = self._monitor.foreign_requests[node.node_id]
        if pause:
            self.command(objects.NmtCommand.ENTER_PRE_OPERATIONAL, node)
        with self.sdo_client(node) as sdo:
            setup = DeviceSetup(sdo, node, self._monitor.heartbeats, self._settings.sdo_retries,
                                is_interrupted=lambda: self._interrupts != interrupts)
            try:
                as_set = setup.run(boot_timeout, self._settings.heartbeat_ms)
            except DeviceError:
                # a late answer of a second device may look like a value that the device does not accept
                self._refuse_two_devices(node, sdo, foreign_requests)
                raise
            self._refuse_two_devices(node, sdo, foreign_requests)
        return as_set

    def _refuse_two_devices(self, node: CanopenNode, sdo: OwnSdoClient, foreign_requests: int) -> None:
        """Raise TwoDevicesError if most requests have had two answers.

        Answers to another client do not count. ``foreign_requests`` is the number of its requests before ours.
        """
        is_alone = self._monitor.foreign_requests[node.node_id] == foreign_requests
        if is_alone and 2 * sdo.doubled > sdo.requests:
            raise TwoDevicesError(node.label, expected='one device with this node-ID', remedy='Switch one of them '
                                  'off, and change the node-ID of the other.',
                                  got=f'a second answer to {sdo.doubled} of {sdo.requests} requests')

    def interrupt(self) -> None:
        """Interrupt all configurations in progress.

        Any thread may call ``interrupt``; the call returns immediately.
        """
        self._interrupts += 1

    def read_errors(self, node: CanopenNode) -> DeviceErrors:
        """Return the error register and the newest errors of a device. Raises BusError."""
        with self.sdo_client(node) as sdo:
            return read_errors(sdo)

    def auto_zero(self, pad: str) -> int:
        """Tell all devices of a pad to zero themselves; see `FrameSource.auto_zero`."""
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
        """Wait until a started node reports OPERATIONAL.

        The timeout is the longer of ``boot_timeout`` and START_PERIOD, plus three heartbeat times. The driver
        repeats NMT start every START_PERIOD, because the first command may be lost.

        Parameters
        ----------
        node : CanopenNode
            Node to which NMT start was sent.
        since : float
            Time on the monotonic clock [s]. Heartbeats received before this time do not count.

        Raises
        ------
        DeviceError
            Raised if the node does not become OPERATIONAL in time. The error message lists the errors that the device
            reports.
        BusError
            Raised if a command or request cannot be sent.
        """
        end = time.monotonic() + max(self._settings.boot_timeout, START_PERIOD) + 3e-3 * self._settings.heartbeat_ms
        while time.monotonic() < end:
            if self._monitor.heartbeats.wait_for(node.node_id, objects.NmtState.OPERATIONAL, since, START_PERIOD):
                return
            self.command(objects.NmtCommand.START, node)
        state = self._monitor.heartbeats.of(node.node_id).state
        heard = 'no heartbeat' if state is None else f'its heartbeat ({objects.state_name(state)})'
        raise DeviceError(node.label, expected='OPERATIONAL after NMT start', got=f'{heard}; {self.read_errors(node)}',
                          remedy='See the manual of the device; after an error, it may refuse to start.')
