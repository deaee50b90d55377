"""Finds the CANopen nodes of a bus: listens to heartbeats, then reads a few objects of each by SDO. Writes nothing."""

import threading
import time
from collections.abc import Iterable
from typing import NamedTuple

import can
from canopen import ObjectDictionary, SdoAbortedError, SdoCommunicationError
from canopen.sdo.constants import REQUEST_UPLOAD

from tactile_node.assembly.router import non_data_kind
from tactile_node.bus.bus_network import BusNetwork, open_bus
from tactile_node.bus.reception import Batch
from tactile_node.cia301 import objects
from tactile_node.cia301.heartbeat import nmt_state
from tactile_node.cia301.sdo import SDO_BYTES
from tactile_node.errors import BusError, ConfigurationError
from tactile_node.skin.eds_rules import Identity

ANSWER_TIMEOUT = 0.5  #: s for the first answer of a node
DEVICE_TYPE_REQUEST = bytes((REQUEST_UPLOAD, objects.DEVICE_TYPE & 0xFF, objects.DEVICE_TYPE >> 8, 0, 0, 0, 0, 0))


class FoundNode(NamedTuple):
    """One node as it was heard; None for what it did not say."""

    node_id: int
    answers: bool             #: by SDO
    state: int | None         #: NMT state, by its last heartbeat
    heartbeat_period: float | None  #: between two heartbeats that were heard [s]
    heartbeat_time: float | None    #: 0x1017, as it is set [s]; 0: it sends none
    device_type: int | None
    name: str | None
    identity: Identity


class NodeScan:
    """What was heard on a bus; ``received`` is called on the thread of the reception."""

    def __init__(self) -> None:
        self.can_frames = 0
        self.error_frames = 0  #: also one for each damaged line of an slcan adapter
        self.answered: set[int] = set()
        self._states: dict[int, int] = {}
        self._heard: dict[int, list[float]] = {}
        self._lock = threading.Lock()

    def received(self, batch: Batch) -> None:
        """Note heartbeats and answers to the first request."""
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

    def ask(self, network: BusNetwork, node_ids: Iterable[int]) -> None:
        """Ask for device types, and wait for the last answer. Raises BusError."""
        for node_id in node_ids:
            network.send_message(objects.SDO_REQUEST + node_id, DEVICE_TYPE_REQUEST)
            time.sleep(0.002)  # between two requests: a bus in use stays usable
        time.sleep(ANSWER_TIMEOUT)

    def nodes(self, network: BusNetwork | None) -> list[FoundNode]:
        """Return all that were heard, by node-ID; with a ``network``, what they say of themselves. Raises BusError."""
        with self._lock:
            node_ids = sorted(self.answered | self._states.keys())
        return [self._node(node_id, network if node_id in self.answered else None) for node_id in node_ids]

    def _node(self, node_id: int, network: BusNetwork | None) -> FoundNode:
        said = {} if network is None else _read(network, node_id)
        with self._lock:
            heard = self._heard.get(node_id, [])
            period = (heard[-1] - heard[0]) / (len(heard) - 1) if len(heard) > 1 else None
            state = self._states.get(node_id)
        name, heartbeat = said.get((objects.DEVICE_NAME, 0)), _number(said.get((objects.PRODUCER_HEARTBEAT_TIME, 0)))
        return FoundNode(node_id, network is not None, state, period, None if heartbeat is None else heartbeat / 1000,
                         _number(said.get((objects.DEVICE_TYPE, 0))),
                         None if name is None else name.decode('latin-1').rstrip('\0 '),
                         Identity(*(_number(said.get((objects.IDENTITY, sub))) for sub in (1, 2, 3))))


def _read(network: BusNetwork, node_id: int) -> dict[tuple[int, int], bytes]:
    """Return what can be read of these objects."""
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


#: bit/s, of CiA 301 (5.4): first those in use for skins
SCANNED_BIT_RATES = (1_000_000, 500_000, 250_000, 125_000, 800_000, 50_000, 20_000, 10_000)
OPENING_TIME = 0.1  #: s after opening, of which frames do not count: lines cut by the change may come
BY_IP_LINK = ('The bit rate is set by "ip link set {channel} down", then "ip link set {channel} up type can bitrate '
              '500000 listen-only on", and so on; candump shows whether frames come.')


def find_bit_rate(interface: str, channel: str, listen: float) -> int:
    """Return the bit rate [bit/s] at which sound frames and no others come within ``listen`` [s].

    Raises ConfigurationError for an interface that cannot do it, BusError where there is no such bit rate.
    """
    if interface != 'slcan':
        by_hand = BY_IP_LINK if interface == 'socketcan' else 'Only these find it: slcan.'
        raise ConfigurationError('--bitrate', expected=f'a number, with interface {interface}', got='auto',
                                 remedy=by_hand.format(channel=channel))
    heard = []
    for bitrate in SCANNED_BIT_RATES:
        frames, error_frames = _listen_at(channel, bitrate, listen)
        if frames and not error_frames:  # at another bit rate no CRC is right, and no frame sound
            return bitrate
        if error_frames:
            heard.append(f'{bitrate / 1000:g} kbit/s: {frames} ({error_frames} error frames)')
    raise BusError(f'CAN bus {interface} {channel}', got=', '.join(heard) or 'no frames',
                   expected=f'sound frames and no error frames at one of {len(SCANNED_BIT_RATES)} bit rates',
                   remedy='At least two other nodes have to be on the bus, and one of them has to send, such as a '
                          'heartbeat. The adapter has to know the command L (listen only); CANable 2.0 as delivered '
                          'does not. Otherwise give the bit rate.')


def _listen_at(channel: str, bitrate: int, listen: float) -> tuple[int, int]:
    """Return how many sound frames and error frames come, for as long as the bit rate may be right. Raises BusError."""
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
