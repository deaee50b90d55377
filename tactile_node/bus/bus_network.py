"""python-can's bus and canopen's network, joined so that nothing a listener does can stop the reception."""

import errno
import logging
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import can
from canopen import Network, ObjectDictionary

from tactile_node.bus.own_sdo import OwnSdoClient
from tactile_node.bus.slcan_bus import BulkSlcanBus
from tactile_node.errors import BusError
from tactile_node.frames.health import BusFault
from tactile_node.recording.log_writer import CanLogWriter

logger = logging.getLogger(__name__)
# The caller reports an SDO timeout; canopen's own log line adds nothing and names no node
logging.getLogger('canopen.sdo').setLevel(logging.CRITICAL)

OnFailure = Callable[[BusFault, Exception], None]

RECEIVE_TIMEOUT = 0.1  # s the notifier waits at most, hence how long close() may take

_NOT_INSTALLED = 'Check the name, and install what this interface needs (slcan: pyserial).'
_REMEDIES = {
    'socketcan': 'Is it up? "ip link set {channel} up type can bitrate {bitrate}"; "ip link" lists them.',
    'slcan': 'Check the device path, and that you may open it (group dialout).'}


def open_bus(interface: str, channel: str, bitrate: int, options: Mapping[str, Any]) -> can.BusABC:
    """Open a python-can bus. Raises BusError."""
    try:
        if interface == 'slcan':
            return BulkSlcanBus(channel, bitrate=bitrate, **options)
        return can.Bus(interface=interface, channel=channel, bitrate=bitrate, ignore_config=True, **options)
    except Exception as error:
        # Each backend of python-can raises its own: CanError, OSError, ValueError, ImportError
        missing = isinstance(error, (can.CanInterfaceNotImplementedError, ImportError))
        remedy = _NOT_INSTALLED if missing else _remedy(interface, channel, error)
        raise BusError(f'CAN bus {interface} {channel}', expected=f'a bus that opens at {bitrate} bit/s',
                       got=f'{type(error).__name__}: {error}',
                       remedy=remedy.format(channel=channel, bitrate=bitrate)) from error


def _remedy(interface: str, channel: str, error: Exception) -> str:
    if getattr(error, 'errno', None) == errno.EAFNOSUPPORT:
        return 'This kernel has no SocketCAN: load its modules (modprobe can can_raw), or use another interface.'
    if interface == 'socketcan' and channel.startswith('vcan'):
        return 'Is it there? "ip link add dev {channel} type vcan && ip link set {channel} up".'
    return _REMEDIES.get(interface, 'Check interface and channel.')


class BusNetwork(Network):
    """A canopen Network with its own reception: every message first goes to ``on_message``, then to canopen.

    ``on_sent(COB-ID, data)`` is called before each own frame, and must return at once.
    One object lasts from open to close: a notifier whose thread has ended does not start again.
    """

    def __init__(self, bus: can.BusABC, on_message: Callable[[can.Message], None],
                 on_failure: OnFailure, record: CanLogWriter | None = None, name: str = '',
                 on_sent: Callable[[int, bytes], None] = lambda can_id, data: None):
        super().__init__(bus)
        self._open_bus = bus
        self._on_sent = on_sent
        self._sdo_turns: defaultdict[int, threading.Lock] = defaultdict(threading.Lock)
        self._record = record
        self._name = name or str(bus.channel_info)
        self.order = threading.Lock()  #: held while a frame is recorded and handed on: both in one order
        self.receiver = can.Notifier(bus, [_Receiver(self, on_message, on_failure, record)], RECEIVE_TIMEOUT)

    def send_message(self, can_id: int, data: bytes, remote: bool = False,
                     stamp: float | None = None, announce: Callable[[], None] = lambda: None) -> None:
        """Send a frame from any thread, recorded with ``stamp`` or now; BusError when that fails.

        ``announce`` is called before the frame is on the bus, in one order with the recording.
        """
        message = can.Message(time.time() if stamp is None else stamp, can_id, False, data=data,
                              is_remote_frame=remote, is_rx=False)
        with self.send_lock:
            with self.order:
                announce()
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
        client = OwnSdoClient(node_id, dictionary, timeout)
        client.network = self
        with self._sdo_turns[node_id]:
            self.subscribe(client.tx_cobid, client.on_response)
            try:
                yield client
            finally:
                self.unsubscribe(client.tx_cobid, client.on_response)

    def close(self) -> None:
        """Stop receiving and close the bus; allowed on a dead bus. The recording stays open."""
        self.receiver.stop(timeout=10 * RECEIVE_TIMEOUT)
        try:
            self._open_bus.shutdown()
        except (can.CanError, OSError):  # an adapter that was pulled out cannot be closed
            pass


class _Receiver(can.Listener):
    def __init__(self, network: BusNetwork, on_message: Callable[[can.Message], None], on_failure: OnFailure,
                 record: CanLogWriter | None):
        self._subscribers = network.subscribers
        self._on_message = on_message
        self._record = record
        self._on_failure = on_failure
        self._order = network.order

    def on_message_received(self, msg: can.Message) -> None:
        with self._order:
            if self._record:
                self._record.write(msg)
            self._on_message(msg)
        if msg.is_error_frame or msg.is_remote_frame or msg.is_extended_id:
            return
        for callback in tuple(self._subscribers.get(msg.arbitration_id, ())):
            try:
                callback(msg.arbitration_id, msg.data, msg.timestamp)
            except BusError as error:  # the answer to it could not be sent
                self._on_failure(BusFault.SENDING_FAILED, error)
            except Exception:  # canopen over a malformed frame; the reception must continue
                logger.exception('CAN frame 0x%03X#%s', msg.arbitration_id, msg.data.hex())

    def on_error(self, exc: Exception) -> None:
        self._on_failure(BusFault.RECEPTION_FAILED, exc)
        time.sleep(RECEIVE_TIMEOUT)  # python-can calls again at once, and a dead adapter fails at once

    def stop(self) -> None:
        """Nothing to give back."""
