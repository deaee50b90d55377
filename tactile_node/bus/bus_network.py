"""python-can's bus and canopen's network, joined so that nothing a subscriber does can stop the reception."""

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
from tactile_node.bus.slcan_bus import BulkSlcanBus
from tactile_node.cia301.objects import BIT_RATES
from tactile_node.errors import BusError, ConfigurationError
from tactile_node.logs.log_writer import CanLogWriter

logger = logging.getLogger(__name__)
# The caller reports an SDO timeout; canopen's own log line adds nothing and names no node
logging.getLogger('canopen.sdo').setLevel(logging.CRITICAL)

OnFailure = Callable[[BusFault, Exception], None]

_REMEDIES = {
    'socketcan': 'Is it up? "ip link set {channel} up type can bitrate {bitrate}"; "ip link" lists them.',
    'slcan': 'Check the device path, end what else has it open, and see that you may open it (group dialout).',
    'kvaser': 'Use the interface socketcan with the Linux driver kvaser_usb: on Linux, python-can 4.6 opens no adapter '
              'through CANlib (docs/adapters.md).',
    'pcan': 'Use the interface socketcan with the Linux driver peak_usb, or install PCAN-Basic (docs/adapters.md).'}
#: interface -> library of the adapter's maker that python-can loads
_LIBRARIES = {'kvaser': 'CANlib', 'pcan': 'PCAN-Basic'}


def check_bit_rate(bitrate: int) -> None:
    """Raise ConfigurationError for a bit rate that no CANopen device has."""
    if bitrate not in BIT_RATES:
        raise ConfigurationError('bitrate', expected=f'one of {", ".join(map(str, BIT_RATES))} bit/s', got=str(bitrate),
                                 remedy='Give the bit rate that is set on the devices.')


def open_bus(interface: str, channel: str, bitrate: int, **options: Any) -> can.BusABC:
    """Open a python-can bus. Raises BusError; ConfigurationError for an interface or bit rate that there is not."""
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
        # Each backend of python-can raises its own: CanError, OSError, ValueError, ImportError, NameError
        is_without_library = interface in _LIBRARIES and isinstance(error, (NameError, OSError))
        raise BusError(f'CAN bus {interface} {channel}', expected=f'a bus that opens at {bitrate} bit/s',
                       got=f'no library {_LIBRARIES[interface]} of its maker' if is_without_library
                       else f'{type(error).__name__}: {error}'.rstrip('.'),
                       remedy=_remedy(interface, channel, error).format(channel=channel, bitrate=bitrate)) from error


def _remedy(interface: str, channel: str, error: Exception) -> str:
    if isinstance(error, (can.CanInterfaceNotImplementedError, ImportError)):
        return 'Check the name, and install what this interface needs (slcan: pyserial).'
    if getattr(error, 'errno', None) == errno.EAFNOSUPPORT:
        return 'This kernel has no SocketCAN: load its modules (modprobe can can_raw), or use another interface.'
    if interface == 'socketcan' and channel.startswith('vcan'):
        return 'Is it there? "ip link add dev {channel} type vcan && ip link set {channel} up".'
    return _REMEDIES.get(interface, 'Check interface and channel.')


class BusNetwork(Network):
    """A canopen Network with its own reception: every batch of messages first goes to ``on_batch``, then to canopen.

    ``on_sent(COB-ID, data)`` is called before each own frame, and must return at once.
    One object lasts from open to close.
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
        self._order = threading.Lock()  # held while frames are recorded and handed on: both in one order
        self._reception = Reception(bus, self._received,
                                    lambda error: on_failure(BusFault.RECEPTION_FAILED, error))

    def send_message(self, can_id: int, data: bytes, remote: bool = False,
                     announce: Callable[[], float] = lambda: time.time()) -> None:
        """Send a frame from any thread; BusError when that fails.

        ``announce`` gives the time for the recording [s]. It is called before the frame is on the bus, in one order
        with the recording, while no other thread sends.
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
                               remedy='Check cable, termination and the other nodes.') from error

    @contextmanager
    def sdo_client(self, node_id: int, dictionary: ObjectDictionary, timeout: float) -> Iterator[OwnSdoClient]:
        """SDO with one device, one at a time; each answer may take ``timeout`` [s].

        Not canopen's RemoteNode: that also keeps every EMCY for ever.
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
        """Stop receiving and close the bus; allowed on a dead bus. The recording stays open."""
        self._reception.stop()
        try:
            self._open_bus.shutdown()
        except (can.CanError, OSError):  # an adapter that was pulled out cannot be closed
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
            except BusError as error:  # the answer to it could not be sent
                self._on_failure(BusFault.SENDING_FAILED, error)
            except Exception:  # canopen over a malformed frame; the reception must continue
                logger.exception('CAN frame 0x%03X#%s', message.arbitration_id, message.data.hex())
