"""Find the CANopen nodes of a bus and the bit rate of an unknown bus.

The scan listens for heartbeats and then reads a few objects of each node by SDO. The scan writes no object.
"""

import threading
import time
from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

import can
from canopen import ObjectDictionary, SdoAbortedError, SdoCommunicationError
from canopen.sdo.constants import REQUEST_UPLOAD

from tactile_node.assembly.router import non_data_kind
from tactile_node.bus.batch_reader import Batch
from tactile_node.bus.bus_network import BusNetwork
from tactile_node.bus.open_bus import open_bus
from tactile_node.cia301 import objects
from tactile_node.cia301.heartbeat import nmt_state
from tactile_node.cia301.sdo import SDO_BYTES
from tactile_node.errors import BusError, ConfigurationError
from tactile_node.skin.eds_rules import Identity

ANSWER_TIMEOUT = 0.5  #: Time allowed for a node to answer an SDO request [s].
DEVICE_TYPE_REQUEST = bytes((REQUEST_UPLOAD, objects.DEVICE_TYPE & 0xFF, objects.DEVICE_TYPE >> 8, 0, 0, 0, 0, 0))
#: Bytes that name the device type, in a request and in its answer.
DEVICE_TYPE = DEVICE_TYPE_REQUEST[1:4]


class FoundNode(NamedTuple):
    """Describes one node found by the scan. A field is None if the node did not report the value."""

    node_id: int
    answers: bool             #: True if the node answers SDO requests
    is_doubled: bool          #: True if several devices have answered the same request
    state: int | None         #: NMT state in the node's last heartbeat
    heartbeat_period: float | None  #: mean time between the received heartbeats [s]
    heartbeat_time: float | None    #: heartbeat time configured in object 0x1017 [s]; 0 if the node sends no heartbeat
    device_type: int | None   #: object 0x1000
    name: str | None          #: device name, read from object 0x1008
    identity: Identity        #: object 0x1018


class NodeScan:
    """Collects the heartbeats and SDO answers received on a bus. The reception thread calls ``received``."""

    def __init__(self) -> None:
        self.can_frames = 0  #: CANopen frames received
        self.error_frames = 0  #: error frames received, including one for each damaged line from an slcan adapter
        self.answered: set[int] = set()  #: node-IDs that have answered an SDO request
        self._device_types: Counter[int] = Counter()  #: number of answers minus requests, by node-ID
        self._states: dict[int, int] = {}
        self._heard: dict[int, list[float]] = {}
        self._lock = threading.Lock()

    def received(self, batch: Batch) -> None:
        """Record the heartbeats and SDO answers in ``batch``."""
        with self._lock:
            self.error_frames += sum(message.is_error_frame for message in batch.messages)
            for message in (one for one in batch.messages if non_data_kind(one) is None):
                can_id, data = message.arbitration_id, bytes(message.data)
                self.can_frames += 1
                alive, state = objects.node_of(can_id, objects.HEARTBEAT), nmt_state(data)
                if alive is not None and state is not None:
                    self._states[alive] = state
                    self._heard.setdefault(alive, []).append(time.monotonic())
                elif (server := objects.node_of(can_id, objects.SDO_RESPONSE)) is not None and len(data) == SDO_BYTES:
                    self.answered.add(server)
                    self._device_types[server] += data[1:4] == DEVICE_TYPE
                elif (asked := objects.node_of(can_id, objects.SDO_REQUEST)) is not None:  # by another SDO client
                    self._device_types[asked] -= data[1:4] == DEVICE_TYPE

    def ask(self, network: BusNetwork, node_ids: Iterable[int]) -> None:
        """Request the device type of each node in ``node_ids``, then wait for ANSWER_TIMEOUT. Raises BusError."""
        for node_id in node_ids:
            with self._lock:
                self._device_types[node_id] -= 1
            network.send_message(objects.SDO_REQUEST + node_id, DEVICE_TYPE_REQUEST)
            time.sleep(0.002)  # the scan must not disturb a bus in use
        time.sleep(ANSWER_TIMEOUT)

    def nodes(self, network: BusNetwork | None) -> list[FoundNode]:
        """Return the nodes found so far, in the order of their node-IDs.

        Parameters
        ----------
        network : BusNetwork or None
            Network used to read the objects of each node that answers; None to read no objects.

        Raises
        ------
        BusError
            Raised if a request cannot be sent.
        """
        with self._lock:
            node_ids = sorted(self.answered | self._states.keys())
            doubled = {node_id for node_id, surplus in self._device_types.items() if surplus > 0}
        return [self._node(node_id, network if node_id in self.answered else None, node_id in doubled)
                for node_id in node_ids]

    def _node(self, node_id: int, network: BusNetwork | None, is_doubled: bool) -> FoundNode:
        said = {} if network is None else _read(network, node_id)
        with self._lock:
            heard = self._heard.get(node_id, [])
            period = (heard[-1] - heard[0]) / (len(heard) - 1) if len(heard) > 1 else None
            state = self._states.get(node_id)
        name, heartbeat = said.get((objects.DEVICE_NAME, 0)), _number(said.get((objects.PRODUCER_HEARTBEAT_TIME, 0)))
        return FoundNode(node_id, network is not None, is_doubled, state, period,
                         None if heartbeat is None else heartbeat / 1000, _number(said.get((objects.DEVICE_TYPE, 0))),
                         None if name is None else name.decode('latin-1').rstrip('\0 '),
                         Identity(*(_number(said.get((objects.IDENTITY, sub))) for sub in (1, 2, 3))))


def _read(network: BusNetwork, node_id: int) -> dict[tuple[int, int], bytes]:
    """Return the data of all readable objects, by index and sub-index."""
    found = {}
    with network.sdo_client(node_id, ObjectDictionary(), ANSWER_TIMEOUT) as sdo:
        for index, sub in ((objects.DEVICE_TYPE, 0), (objects.DEVICE_NAME, 0), (objects.PRODUCER_HEARTBEAT_TIME, 0),
                           *((objects.IDENTITY, sub) for sub in (1, 2, 3))):
            try:
                found[index, sub] = bytes(sdo.upload(index, sub))
            except (SdoAbortedError, SdoCommunicationError):
                continue
    return found


def _number(data: bytes | None) -> int | None:
    return None if data is None else int.from_bytes(data, 'little')


#: Bit rates defined by CiA 301 (5.4), in the order in which they are tried [bit/s]. Bit rates that are common for skins
#: come first.
SCANNED_BIT_RATES = (1_000_000, 500_000, 250_000, 125_000, 800_000, 50_000, 20_000, 10_000)
#: Time after opening during which frames are ignored [s]. Changing the bit rate may truncate lines from the adapter.
OPENING_TIME = 0.1
BY_IP_LINK = ('Try one bit rate after another: "ip link set {channel} down", then "ip link set {channel} up type can '
              'bitrate 500000 listen-only on". Use candump to see whether frames are received.')


def find_bit_rate(interface: str, channel: str, listen: float) -> int:
    """Find the bit rate at which all received frames are valid.

    Parameters
    ----------
    interface : str
        python-can interface name; only 'slcan' is supported.
    channel : str
        Serial port of the adapter.
    listen : float
        Time spent listening at each bit rate [s].

    Returns
    -------
    int
        Bit rate [bit/s].

    Raises
    ------
    ConfigurationError
        Raised if the interface cannot detect the bit rate.
    BusError
        Raised if no bit rate yields valid frames without error frames.
    """
    if interface != 'slcan':
        by_hand = BY_IP_LINK if interface == 'socketcan' else 'Give the bit rate; only slcan can find it.'
        raise ConfigurationError('--bitrate', expected=f'a number, with interface {interface}', got='auto',
                                 remedy=by_hand.format(channel=channel))
    heard = []
    for bitrate in SCANNED_BIT_RATES:
        frames, error_frames = _listen_at(channel, bitrate, listen)
        if frames and not error_frames:  # at a wrong bit rate, every CRC is wrong
            return bitrate
        if error_frames:
            heard.append(f'{bitrate / 1000:g} kbit/s: {frames} ({error_frames} error frames)')
    raise BusError(f'CAN bus {interface} {channel}', got=', '.join(heard) or 'no frames',
                   expected=f'valid frames and no error frames at one of {len(SCANNED_BIT_RATES)} bit rates',
                   remedy='Connect at least two other nodes, and let one of them send frames, such as a heartbeat. The '
                          'adapter must support the command L (listen only); a CANable 2.0 as delivered does not. '
                          'Otherwise give the bit rate.')


def _listen_at(channel: str, bitrate: int, listen: float) -> tuple[int, int]:
    """Return the number of valid frames and the number of error frames at one bit rate. Raises BusError.

    The function listens for ``listen`` [s], or until it has received ten valid frames or one error frame.
    """
    frames = error_frames = 0
    bus = open_bus('slcan', channel, bitrate, listen_only=True)
    try:
        begun = time.monotonic()
        while frames < 10 and not error_frames and (left := begun + OPENING_TIME + listen - time.monotonic()) > 0:
            message = bus.recv(left)
            if message is not None and time.monotonic() >= begun + OPENING_TIME:
                frames += not message.is_error_frame
                error_frames += message.is_error_frame
    except (can.CanError, OSError) as error:
        raise BusError(f'CAN bus slcan {channel}', expected='to receive', got=str(error),
                       remedy='Check the adapter.') from error
    finally:
        bus.shutdown()
    return frames, error_frames
