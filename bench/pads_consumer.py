"""The consumer of bench_pads.py: counts and states of all nodes, shapes of some pads, and the drivers' transitions."""

import re
import struct
import time
from collections.abc import Callable
from typing import NamedTuple

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from pads_cases import Case, namespace
from pads_ledger import Station
from rclpy.qos import QoSProfile

from tactile_node.assembly.health import NodeFault, Overload
from tactile_node.nodes.spinning import FrameExecutor
from tactile_node.ros.qos import STATUS_QOS, frames_qos
from tactile_skin.msg import ContactShape, SkinStatus

WATCHED = 4  #: pads whose shapes are received, at most: the consumer shares the processors with what it measures
SIGNS_AFTER = 1.5  #: s: what a node reports so long after the end is all that it has counted
TIMEOUT = 60.0  #: s


class Head(NamedTuple):
    """The first fields of a ContactShape, read from its bytes."""

    stamp: float
    sequence: int
    left_out: int


def head_of(message: bytes) -> Head:
    """CDR, little-endian (OMG CORBA 15.3; RTPS 10.2): 4 bytes of header, then each number aligned to its size."""
    second, nanosecond, length = struct.unpack_from('<iII', message, 4)
    place = 4 + -(-(12 + length) // 8) * 8
    sequence, left_out = struct.unpack_from('<QI', message, place)
    return Head(second + 1e-9 * nanosecond, sequence, left_out)


class Seen:
    """The shapes of one pad since the last ``clear``. span = received + left_out + gaps."""

    def __init__(self, sweep_end: float):
        self._sweep_end = sweep_end
        self.clear()

    def clear(self) -> None:
        self.late: list[float] = []  #: [s], since the last TPDO of the sweep was on the wire
        self.left_out = self.gaps = 0
        self._sequence: int | None = None

    def __call__(self, message: bytes) -> None:
        now, head = time.time(), head_of(message)
        self.late.append(now - head.stamp - self._sweep_end)
        if self._sequence is not None:
            left_out = min(head.left_out, head.sequence - self._sequence - 1)
            self.left_out += left_out
            self.gaps += head.sequence - self._sequence - 1 - left_out
        self._sequence = head.sequence


class Consumer:
    """Has a separate context as long as the block lasts."""

    def __init__(self, case: Case):
        self._case = case
        self.statuses: dict[str, SkinStatus] = {}  #: newest of each bus
        self.stations: dict[str, Station] = {}     #: newest of each processor and classifier, by full name
        self.levels: dict[str, set[str]] = {}      #: what nodes and drivers reported: text by who
        self.overloads: set[Overload] = set()
        self._heard: dict[str, float] = {}

    def __enter__(self) -> 'Consumer':
        rclpy.init()
        self._node = rclpy.create_node('consumer')
        case = self._case
        pads = [(bus, place) for bus in range(case.buses) for place in range(case.pads)]
        step = -(-len(pads) // WATCHED)
        self.seen = {f'/{namespace(bus)}/pad{place}': Seen(case.sweep_ends[place]) for bus, place in pads[::step]}
        for pad, take in self.seen.items():
            self._node.create_subscription(ContactShape, f'{pad}/shape', take, frames_qos(200), raw=True)
        self._clients = []
        for bus in range(case.buses):
            driver = f'/{namespace(bus)}/skin_driver'
            self._node.create_subscription(SkinStatus, f'{driver}/status', self._status_of(driver), STATUS_QOS)
            self._clients.append(self._node.create_client(ChangeState, f'{driver}/change_state'))
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._diagnosed, QoSProfile(depth=1000))
        self._executor = FrameExecutor()
        self._executor.add_node(self._node)
        return self

    def __exit__(self, *exception: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown()

    def spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def spin_until(self, is_met: Callable[[], bool], what: str, timeout: float = TIMEOUT) -> None:
        """Raises SystemExit after ``timeout`` [s]."""
        end = time.monotonic() + timeout
        while not is_met():
            if time.monotonic() > end:
                raise SystemExit(f'expected {what} within {timeout:g} s')
            self.spin(0.05)

    def are_active(self) -> bool:
        statuses = self.statuses.values()
        return len(statuses) == self._case.buses and all(
            status.lifecycle_state == SkinStatus.ACTIVE for status in statuses)

    def are_shapes(self) -> bool:
        return all(seen.late for seen in self.seen.values())

    def activate(self) -> None:
        self._change(Transition.TRANSITION_ACTIVATE)

    def deactivate(self) -> None:
        """And wait until all nodes have reported what they have counted."""
        self._change(Transition.TRANSITION_DEACTIVATE)
        nodes = self._case.buses * (1 + 2 * self._case.pads)
        after = time.monotonic() + SIGNS_AFTER
        self.spin_until(lambda: sum(heard > after for heard in self._heard.values()) >= nodes, 'all counts')

    def clear(self) -> None:
        for seen in self.seen.values():
            seen.clear()
        self.levels.clear()
        self.overloads.clear()

    def _change(self, transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        self.spin_until(lambda: all(client.service_is_ready() for client in self._clients), 'the drivers')
        answers = [client.call_async(request) for client in self._clients]
        self.spin_until(lambda: all(answer.done() for answer in answers), 'the end of a transition')
        if not all(answer.result().success for answer in answers):
            raise SystemExit(f'expected that transition {transition} succeeds, it has failed')

    def _status_of(self, driver: str) -> Callable[[SkinStatus], None]:
        def take(status: SkinStatus) -> None:
            self.statuses[driver] = status
            self._heard[driver] = time.monotonic()
            self.overloads.add(Overload(status.overload))
            if status.level > SkinStatus.OK:
                self.levels.setdefault('driver', set()).update(_findings(status))
        return take

    def _diagnosed(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            if 'overtaken' not in values or status.name.endswith('/grasp'):
                continue
            dropped = sum(int(value) for key, value in values.items() if key.startswith('dropped_'))
            self.stations[status.name] = Station(*(int(values[name]) for name in (
                'received', 'processed', 'skipped', 'overtaken')), dropped)
            self._heard[status.name] = time.monotonic()
            if values['faults'] != 'NONE':
                self.levels.setdefault(status.name.rsplit('/', 1)[1], set()).update(values['faults'].split(', '))


def _findings(status: SkinStatus) -> list[str]:
    """What the driver reports, without the numbers."""
    found = status.message.removeprefix('growing: ').split(', ') if status.message != 'nothing lost' else []
    for pad in status.pads:
        found += re.findall(r'TPDOs missing|TPDOs lost \(\w+\)', pad.message)
        found += [NodeFault(node.fault).name for node in pad.nodes if NodeFault(node.fault).is_fault]
    return found
