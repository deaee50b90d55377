"""Connect a python-can bus to a canopen Network. If a subscriber raises an exception, reception continues."""

import errno
import logging
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any

import can
from canopen import Network, ObjectDictionary

from tactile_node.assembly.health import BusFault
from tactile_node.bus.own_sdo import OwnSdoClient
from tactile_node.bus.reception import Batch, Reception
from tactile_node.bus.slcan_bus import BulkSlcanBus, PortInUseError
from tactile_node.cia301.objects import BIT_RATES
from tactile_node.errors import BusError, ConfigurationError
from tactile_node.logs.log_writer import CanLogWriter

logger = logging.getLogger(__name__)
# The caller reports each SDO timeout with its node, whereas canopen's log line names no node.
logging.getLogger('canopen.sdo').setLevel(logging.CRITICAL)

OnFailure = Callable[[BusFault, Exception], None]

_REMEDIES = {
    'socketcan': 'Check that the interface is up: "ip link" lists all interfaces, "ip link set {channel} up type can '
                 'bitrate {bitrate}" brings it up.',
    'slcan': 'Check the device path, and check that you have permission to open it (group dialout).',
    'kvaser': 'Use the interface socketcan with the Linux driver kvaser_usb. On Linux, python-can 4.6 cannot open an '
              'adapter through CANlib (docs/adapters.md).',
    'pcan': 'Use the interface socketcan with the Linux driver peak_usb, or install PCAN-Basic (docs/adapters.md).'}
_REMEDY_IN_USE = ('Only one program can use a serial port. Close the other program. If it is the driver, let the '
                  'driver record (tactile bringup --record FILE), and view its topics (tactile view).')
#: Manufacturer's library that python-can loads, by interface.
_LIBRARIES = {'kvaser': 'CANlib', 'pcan': 'PCAN-Basic'}


def check_bit_rate(bitrate: int) -> None:
    """Raise ConfigurationError if ``bitrate`` [bit/s] is not a standard CANopen bit rate (CiA 301)."""
    if bitrate not in BIT_RATES:
        raise ConfigurationError('bitrate', expected=f'one of {", ".join(map(str, BIT_RATES))} bit/s', got=str(bitrate),
                                 remedy='Give the bit rate to which the devices are set.')


def open_bus(interface: str, channel: str, bitrate: int, **options: Any) -> can.BusABC:
    """Open a python-can bus.

    Parameters
    ----------
    interface : str
        python-can interface name, such as 'socketcan' or 'slcan'.
    channel : str
        Channel of the interface, such as 'can0' or '/dev/ttyACM0'.
    bitrate : int
        Bit rate to which the devices are set [bit/s].
    **options
        Further options for python-can.

    Raises
    ------
    ConfigurationError
        Raised if python-can does not know the interface or the bit rate is not standard.
    BusError
        Raised if the bus cannot be opened.
    """
    check_bit_rate(bitrate)
    if interface not in can.VALID_INTERFACES:
        close = get_close_matches(interface.lower(), can.VALID_INTERFACES, n=1)
        raise ConfigurationError('CAN interface', expected=f'one of {", ".join(sorted(can.VALID_INTERFACES))}',
                                 got=repr(interface),
                                 remedy=f'Did you mean "{close[0]}"?' if close else 'Name one of these.')
    try:
        if interface == 'slcan':
            return BulkSlcanBus(channel, bitrate=bitrate, **options)
        return can.Bus(interface=interface, channel=channel, bitrate=bitrate, ignore_config=True, **options)
    except Exception as error:
        # The exception type depends on the python-can backend: CanError, OSError, ValueError, ImportError or NameError.
        is_without_library = interface in _LIBRARIES and isinstance(error, (NameError, OSError))
        raise BusError(f'CAN bus {interface} {channel}', expected=f'a bus that opens at {bitrate} bit/s',
                       got=f'no library {_LIBRARIES[interface]} of its maker' if is_without_library
                       else f'{type(error).__name__}: {error}'.rstrip('.'),
                       remedy=_remedy(interface, channel, error).format(channel=channel, bitrate=bitrate)) from error


def _remedy(interface: str, channel: str, error: Exception) -> str:
    if isinstance(error, (can.CanInterfaceNotImplementedError, ImportError)):
        return 'Check the name, and install what this interface needs (slcan: pyserial).'
    if isinstance(error, PortInUseError):
        return _REMEDY_IN_USE
    if getattr(error, 'errno', None) == errno.EAFNOSUPPORT:
        return 'This kernel has no SocketCAN. Load its modules (modprobe -a can can_raw), or use another interface.'
    if interface == 'socketcan' and channel.startswith('vcan'):
        return ('Check that the interface exists: "ip link add dev {channel} type vcan && ip link set {channel} up" '
                'creates it.')
    return _REMEDIES.get(interface, 'Check interface and channel.')


class BusNetwork(Network):
    """A canopen Network that receives messages in batches.

    The network passes each batch of messages to ``on_batch`` first, then to canopen.

    One object serves one bus from open to close.

    Parameters
    ----------
    bus : can.BusABC
        Open bus.
    on_batch : callable
        Function that is called with each `Batch`, on the reception thread.
    on_failure : callable
        Function that is called with a `BusFault` and the exception if reception fails, or if canopen cannot send an
        answer.
    record : CanLogWriter or None
        Recording of all received and sent frames.
    name : str
        Name of the bus in error messages.
    on_sent : callable
        Function that is called with the COB-ID and the data of each frame before this network sends it. The callback
        must return immediately.
    """

    def __init__(self, bus: can.BusABC, on_batch: Callable[[Batch], None],
                 on_failure: OnFailure, record: CanLogWriter | None = None, name: str = '',
                 on_sent: Callable[[int, bytes], None] = lambda can_id, data: None):
        super().__init__(bus)
        self._open_bus = bus
        self._on_batch = on_batch
        self._on_failure = on_failure
        self._on_sent = on_sent
        self._sdo_turns: defaultdict[int, threading.Lock] = defaultdict(threading.Lock)
        self._sdo_owed: defaultdict[int, Counter[bytes]] = defaultdict(Counter)  # see OwnSdoClient
        self._record = record
        self._name = name or str(bus.channel_info)
        self._order = threading.Lock()  # the recording keeps the order in which threads pass frames to the bus
        self._reception = Reception(bus, self._received,
                                    lambda error: on_failure(BusFault.RECEPTION_FAILED, error))

    def send_message(self, can_id: int, data: bytes, remote: bool = False,
                     announce: Callable[[], float] = lambda: time.time()) -> None:
        """Send a frame. Any thread may call ``send_message``.

        Parameters
        ----------
        can_id : int
            COB-ID of the frame.
        data : bytes
            Data of the frame.
        remote : bool
            True for a remote frame.
        announce : callable
            Function that returns the time of the frame for the recording [s]. The network calls this function before
            the frame is on the bus, and while no other thread is sending. The recording holds the frames in the order
            of these calls.

        Raises
        ------
        BusError
            Raised if the frame cannot be sent.
        """
        with self.send_lock:
            with self._order:
                message = can.Message(announce(), can_id, False, data=data, is_remote_frame=remote, is_rx=False)
                self._on_sent(can_id, data)
                if self._record:
                    self._record.write(message)
            try:
                self._open_bus.send(message)
            except (can.CanError, OSError, ValueError) as error:
                raise BusError(f'CAN bus {self._name}', expected=f'to send 0x{can_id:03X}',
                               got=str(error),
                               remedy='Check the cable, the termination and the other nodes.') from error

    @contextmanager
    def sdo_client(self, node_id: int, dictionary: ObjectDictionary, timeout: float) -> Iterator[OwnSdoClient]:
        """Yield an SDO client for one device.

        Only one client per device is active at a time. Other threads wait until that client is closed.

        canopen's RemoteNode is not used, because it stores an unlimited number of EMCY messages.

        Parameters
        ----------
        node_id : int
            Node-ID of the device.
        dictionary : ObjectDictionary
            Object dictionary of the device.
        timeout : float
            Time allowed for each answer [s].
        """
        client = OwnSdoClient(node_id, dictionary, timeout, self._sdo_owed[node_id])
        client.network = self
        with self._sdo_turns[node_id]:
            self.subscribe(client.tx_cobid, client.on_response)
            try:
                yield client
            finally:
                self.unsubscribe(client.tx_cobid, client.on_response)

    def close(self) -> None:
        """Stop receiving and close the bus.

        The method also works if the adapter is gone. The recording remains open.
        """
        self._reception.stop()
        try:
            self._open_bus.shutdown()
        except (can.CanError, OSError):  # the adapter was unplugged
            pass

    def _received(self, batch: Batch) -> None:
        with self._order:
            if self._record:
                for message in batch.messages:
                    self._record.write(message)
            self._on_batch(batch)
        for message in batch.messages:
            subscribers = self.subscribers.get(message.arbitration_id)
            if subscribers and not (message.is_error_frame or message.is_remote_frame or message.is_extended_id):
                self._notify(tuple(subscribers), message)

    def _notify(self, subscribers: tuple[Callable[..., None], ...], message: can.Message) -> None:
        for callback in subscribers:
            try:
                callback(message.arbitration_id, message.data, message.timestamp)
            except BusError as error:  # canopen failed to send its answer
                self._on_failure(BusFault.SENDING_FAILED, error)
            except Exception:  # canopen raises an exception on malformed frames, but reception must continue
                logger.exception('CAN frame 0x%03X#%s', message.arbitration_id, message.data.hex())
