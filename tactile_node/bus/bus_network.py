"""Read and write one CAN bus for canopen, and record its CAN frames.

python-can's Notifier wakes up a thread for each CAN frame. On a full bus (7,400 frames/s), waking a thread and
switching the Python interpreter to it takes longer than processing the frame. `BusNetwork` therefore reads batches.
"""

import logging
import threading
import time
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import can
from canopen import Network, ObjectDictionary

from tactile_node.assembly.health import BusFault
from tactile_node.bus.batch_reader import Batch, BatchReader
from tactile_node.bus.own_sdo import OwnSdoClient
from tactile_node.errors import BusError
from tactile_node.logs.log_writer import CanLogWriter
from tactile_node.threads import ReportedThread, call_guarded

logger = logging.getLogger(__name__)
# The caller reports each SDO timeout with its node, whereas canopen's log line names no node.
logging.getLogger('canopen.sdo').setLevel(logging.CRITICAL)

OnFailure = Callable[[BusFault, Exception], None]

RECEIVE_TIMEOUT = 0.1  #: Longest time a read waits for a message [s].
STOP_TIMEOUT = 1.0  #: Time allowed for the reception thread to end [s].

#: Shortest time between two reads on a busy bus [s]. The pause adds at most this time to the age of the taxels.
READ_PAUSE = 0.5e-3
#: If at least this many frames arrive within 0.8 ms, the frames carry taxels and the bus counts as busy. An SDO
#: dialogue is slower and is therefore not delayed.
BUSY_FRAMES = 4


class BusNetwork(Network):
    """A canopen Network that reads an open bus in batches, on the reception thread, until it is closed.

    The network passes each batch of messages to ``on_batch`` first, then to the subscribers of canopen. An exception
    raised by ``on_batch`` is logged and affects only one batch, because it is not a fault of the bus. If a subscriber
    raises an exception, reception continues.

    Parameters
    ----------
    bus : can.BusABC
        Open bus. If the bus has no method ``recv_all``, as `BulkSlcanBus` does, a `BatchReader` reads it.
    on_batch : callable
        Function that is called with each `Batch` that contains messages, on the reception thread.
    on_failure : callable
        Function that is called with a `BusFault` and the exception if a read fails, if the reception thread ends with
        an exception, or if canopen cannot send an answer.
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
        self._recv_all: Callable[[float], Batch] = getattr(bus, 'recv_all', None) or BatchReader(bus).recv_all
        self._recent: deque[float] = deque(maxlen=BUSY_FRAMES)  # times at which the last batches of messages were read
        self._closing = threading.Event()
        self._reception = ReportedThread(self._receive, 'reception', on_death=self._reception_failed)
        self._reception.start()

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

        The method waits until the reception thread has ended, or for STOP_TIMEOUT if a dead adapter blocks the read. It
        also works if the adapter is gone. The recording remains open.
        """
        self._closing.set()
        if self._reception is not threading.current_thread():
            self._reception.join(STOP_TIMEOUT)
        try:
            self._open_bus.shutdown()
        except (can.CanError, OSError):  # the adapter was unplugged
            pass

    def _receive(self) -> None:
        while not self._closing.is_set():
            try:
                batch = self._recv_all(RECEIVE_TIMEOUT)
                if not batch.messages or self._closing.is_set():
                    continue
                begun = time.monotonic()
                call_guarded(self._received, batch)
                if self._is_busy(len(batch.messages), begun):
                    time.sleep(max(0.0, begun + READ_PAUSE - time.monotonic()))
            except Exception as error:  # the exception type depends on the python-can backend
                if not self._closing.is_set():
                    self._reception_failed(error)
                self._closing.wait(RECEIVE_TIMEOUT)  # reading from a dead adapter fails immediately

    def _is_busy(self, messages: int, now: float) -> bool:
        self._recent.extend([now] * min(messages, BUSY_FRAMES))
        return len(self._recent) == BUSY_FRAMES and now - self._recent[0] < 0.8e-3

    def _reception_failed(self, error: Exception) -> None:
        self._on_failure(BusFault.RECEPTION_FAILED, error)

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
