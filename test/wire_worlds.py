"""Pads and their assemblers on a wire in virtual time, on which frames take time and SYNC and TPDOs cross."""

from collections import deque
from collections.abc import Callable, Sequence
from functools import cache
from itertools import chain
from typing import NamedTuple

import numpy as np
from wire import BIT, SYNC_ID, Carried, Node, carried, frame_seconds

from tactile_node.assembly.router import Router
from tactile_node.bus.bus_network import READ_PAUSE
from tactile_node.bus.sync_producer import SyncPause
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.pads import PadSettings
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus

CODES = 251               #: The value in all TPDOs of a sweep is the number of the sweep modulo CODES, plus 1.
ADAPTER = 0.0005  #: Longest delay of a frame in an adapter [s].
TIMEOUT = 0.002  #: Time limit of a read that waits for bytes [s].
HOST, WIRE = 'stamps of the host', 'stamps of the wire'


class Pad(NamedTuple):
    """A pad together with its nodes."""

    layout: str
    node_ids: tuple[int, ...]


class Seen(NamedTuple):
    """Results for one pad: numbers of its whole sweeps and of its fully answered sweeps, and count of wrong frames."""

    whole: list[int]
    answered: list[int]
    wrong: int


ONE, TWO_NODES = (Pad('sim16x16.yaml', (32,)),), (Pad('nodes2_12x8_12bit.yaml', (32, 35)),)
TWO = (Pad('sim16x16.yaml', (32,)), Pad('sim16x16.yaml', (64,)))


def period_at(load: float, pads: Sequence[Pad]) -> float:
    frames = sum(len(load_layout(pad.layout).tpdos) for pad in pads)
    return (frames * frame_seconds(8) + frame_seconds(0)) / load


def played(pads: Sequence[Pad], syncs: Sequence[float], clock: str, *, lost: float = 0.0, seed: int = 0,
           first_skips: Callable[[int], bool] | None = None, chatter: Sequence[Node] = (), **of_nodes) -> list[Seen]:
    """Let the nodes answer ``syncs`` on one wire, and return the CAN frames that the driver receives from each pad.

    ``lost`` is the fraction of TPDOs that are not received. ``first_skips`` returns True for the sweeps that the first
    pad skips. ``chatter`` contains nodes that belong to no pad.
    """
    rng = np.random.default_rng(seed)
    layouts = [load_layout(pad.layout) for pad in pads]
    nodes = [[Node([tpdo.cob_id.of(node_id) for tpdo in layout.tpdos if tpdo.node == place], **of_nodes)
              for place, node_id in enumerate(pad.node_ids)] for pad, layout in zip(pads, layouts)]
    for node in nodes[0] if first_skips is not None else ():
        node.skips = first_skips
    receiver = Receiver(pads, clock)
    period = float(np.median(np.diff(syncs)))
    path = Wire(receiver, period) if clock == WIRE else Adapter(receiver, period, rng)
    for frame in carried(syncs, [*chain.from_iterable(nodes), *chatter], path.is_pause_wanted):
        if frame.can_id == SYNC_ID:
            path.sync(frame)
        elif rng.random() >= lost:
            path.tpdo(frame)
    path.read(np.inf)
    return receiver.seen(nodes)


class Receiver:
    """The part of the driver that turns CAN frames into taxel frames, together with its results."""

    def __init__(self, pads: Sequence[Pad], clock: str):
        self._pads = [PadSettings(str(place), pad.node_ids, load_layout(pad.layout)) for place, pad in enumerate(pads)]
        self._frames: dict[str, list[TaxelFrame]] = {pad.name: [] for pad in self._pads}
        self.router = Router(tuple(self._pads), lambda name, frame: self._frames[name].append(frame),
                             foreign_sync=False, one_clock=clock == WIRE, bitrate=round(1 / BIT))
        self._tpdos = {tpdo.cob_id.of(pad.node_ids[tpdo.node]): (pad.layout, tpdo.length)
                       for pad in self._pads for tpdo in pad.layout.tpdos}
        self._numbers: dict[float, int] = {}  # maps the stamp of each SYNC to its number

    def sync(self, stamp: float, number: int) -> None:
        self._numbers[stamp] = number
        self.router.sync(stamp)

    def tpdo(self, frame: Carried, stamp: float, after: float) -> None:
        data = bytes(8)
        if frame.can_id in self._tpdos:
            layout, length = self._tpdos[frame.can_id]
            value = layout.value
            data = coded(frame.number % CODES + 1, value.bits, value.byte_order)[:length]
        self.router.feed(frame.can_id, data, stamp, after)

    def seen(self, nodes: Sequence[Sequence[Node]]) -> list[Seen]:
        self.router.end()
        assert all(pad.tpdos_received == pad.tpdos_used + pad.tpdos_pending + sum(pad.losses.values())
                   for pad in self.router.facts().pads)
        return [self._seen(pad, own) for pad, own in zip(self._pads, nodes)]

    def _seen(self, pad: PadSettings, nodes: Sequence[Node]) -> Seen:
        whole, wrong, value = [], 0, pad.layout.value
        for frame in self._frames[pad.name]:
            number, valid = self._numbers[frame.stamp], frame.status != TaxelStatus.STALE
            counts = np.round(frame.values[valid] / value.scale).astype(int) + value.offset
            wrong += bool((counts != number % CODES + 1).any())
            whole += [number] if valid.all() else []
        return Seen(whole, sorted(set.intersection(*(set(node.answered) for node in nodes))), wrong)


class Wire:
    """For SocketCAN, a frame is stamped at its end on the wire, and the driver does not receive its own SYNC."""

    def __init__(self, receiver: Receiver, period: float):
        self._receiver = receiver
        self._pause = SyncPause(period)

    def is_pause_wanted(self, now: float) -> bool:
        """Return True if the driver would skip the SYNC that is due at this time."""
        self.read(now)
        return self._pause.is_due(self._receiver.router.is_in_doubt)

    def sync(self, frame: Carried) -> None:
        self._receiver.sync(frame.end, frame.number)

    def tpdo(self, frame: Carried) -> None:
        self._receiver.tpdo(frame, frame.end, frame.end)

    def read(self, until: float) -> None:
        """Read all frames."""


class Adapter(Wire):
    """For slcan, a SYNC is stamped when it is sent, and all other waiting frames are stamped together when read."""

    def __init__(self, receiver: Receiver, period: float, rng: np.random.Generator):
        super().__init__(receiver, period)
        self._rng = rng
        # Pairs of the earliest read time of a frame and the frame itself.
        self._here: deque[tuple[float, Carried]] = deque()
        self._last = 0.0  # arrival time of the last frame [s]
        self._free = self._asked = 0.0  # earliest start of the next read, and start of the last read

    def sync(self, frame: Carried) -> None:
        self.read(frame.offered)
        self._receiver.sync(frame.offered, frame.number)

    def tpdo(self, frame: Carried) -> None:
        self._last = max(self._last, frame.end + self._rng.uniform(0, ADAPTER))
        self._here.append((self._last, frame))

    def read(self, until: float) -> None:
        while self._here and max(self._free, self._here[0][0]) <= until:
            empty_at, self._asked = self._asked, self._free
            first = self._here[0][0]
            if first > self._asked:  # while no frame waits, the read is repeated after each TIMEOUT
                empty_at = self._asked = self._asked + (first - self._asked) // TIMEOUT * TIMEOUT
            read = max(self._asked, first)
            while self._here and self._here[0][0] <= read:
                _, frame = self._here.popleft()
                self._receiver.tpdo(frame, read, empty_at)
            self._free = read + READ_PAUSE


def rising(times: np.ndarray) -> np.ndarray:
    """Return the times without duplicates, because each SYNC has its own stamp."""
    return np.maximum.accumulate(times) + 1e-9 * np.arange(len(times))


@cache
def coded(code: int, bits: int, byte_order: str) -> bytes:
    """Return eight bytes in which every group of ``bits`` bits has the value ``code``."""
    if byte_order == 'little':
        word = sum(code << place for place in range(0, 64 - bits + 1, bits))
        return word.to_bytes(8, 'little')
    word = sum(code << 64 - bits - place for place in range(0, 64 - bits + 1, bits))
    return word.to_bytes(8, 'big')


def random_world(pads: Sequence[Pad], clock: str, seed: int, count: int = 200) -> list[Seen]:
    """Simulate a load of 60 to 105 %, late SYNCs, answers within 15 % of a sweep, lost TPDOs and skipped sweeps."""
    rng = np.random.default_rng(seed)
    shortest = period_at(1.0, pads)
    loads = np.repeat(rng.uniform(0.6, 1.05, count // 20 + 1), 20)[:count]
    syncs = np.cumsum(shortest / loads)
    syncs += rng.uniform(0, 1, count) * (rng.random(count) < 0.05) * shortest / 2
    skipped = set(np.flatnonzero(rng.random(count) < 0.02).tolist())
    delays = rng.uniform(0.0001, 0.15 * shortest, count)
    return played(pads, rising(syncs), clock, lost=rng.choice((0, 0.001, 0.02)), seed=seed,
                  skips=skipped.__contains__, delay=delays.__getitem__)
