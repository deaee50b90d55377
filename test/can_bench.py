"""Helpers that the CAN tests share: a pad small enough to compute by hand, and a driver and a skin on one bus."""

import os
import pty
import queue
import threading
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import can
import numpy as np
from captured_log import CapturedLog

from tactile_node.assembly.facts import LossReason
from tactile_node.assembly.pad_assembler import PadAssembler, TaxelFrames
from tactile_node.bus.skin_bus import BusSettings, SkinBus
from tactile_node.simulator.skin_simulator import SkinSimulator, WireSettings
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.pads import make_pad, make_pads, with_dictionaries
from tactile_node.sources.supervisor import Supervisor
from tactile_node.taxel_frame import TaxelFrame

#: `make socketcan` runs these tests on a real Linux CAN stack, on which all tests share one channel.
INTERFACE = os.environ.get('TACTILE_TEST_INTERFACE', 'virtual')


def channel_of(name: str) -> str:
    """Return the name of the bus that only this test uses."""
    return name if INTERFACE == 'virtual' else 'vcan0'


class TooSlowError(AssertionError):
    """Raised if the machine was too slow for real time. conftest.py then skips the test instead of failing it."""


def is_overloaded() -> bool:
    """Return True if the mean load of the last minute exceeds 1.5 processes per processor."""
    return os.getloadavg()[0] > 1.5 * (os.cpu_count() or 1)


class Served:
    """Context manager for a hand-written device.

    The device's ``_serve`` method runs on a thread until ``_ends`` is set.
    """

    def __init__(self, channel: str):
        self._bus = can.Bus(channel, interface=INTERFACE)
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self) -> 'Served':
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._thread.join(60)
        self._bus.shutdown()

    def _serve(self) -> None:
        raise NotImplementedError


class Master:
    """A CAN bus with simulated skins, controlled by a hand-written master."""

    def __init__(self, name: str):
        self.bus = other_bus(name)

    def send(self, can_id: int, data: str) -> None:
        self.bus.send(can.Message(arbitration_id=can_id, is_extended_id=False, data=bytes.fromhex(data)))

    def sdo(self, request: str) -> str:
        """Return the response of node 32 to an SDO request, as hexadecimal digits."""
        self.send(0x620, request)
        while (answer := self.bus.recv(60)).arbitration_id != 0x5A0:
            pass
        return answer.data.hex().upper()


class SkinMaster(Master):
    """Context manager for a master and one simulated pad with node-ID 32."""

    def __init__(self, name: str, layout: str, source: Callable[[float], np.ndarray]):
        super().__init__(name)
        self.simulator = SkinSimulator([make_pad('pad', 32, layout)], {'pad': source})
        self.simulator.start(INTERFACE, channel_of(name))

    def __enter__(self):
        return self

    def __exit__(self, *_: object) -> None:
        self.simulator.stop()
        self.bus.shutdown()


def other_bus(name: str) -> can.BusABC:
    """Return another participant on the bus ``name``."""
    return can.Bus(channel_of(name), interface=INTERFACE)


#: Layout with 3 x 2 taxels and one row in each TPDO. The value of a taxel is 2 (counts - 10) Pa.
TINY = '''
rows: 3
cols: 2
pitch: 0.003
value: {unit: Pa, scale: 2.0, offset: 10, bits: 8}
tpdos:
- {number: 1, cob_id: $NODEID+0x180, map: [[0x2000, 1, 16]], taxels: [[0, 0, 0], [0, 1, 8]]}
- {number: 2, cob_id: $NODEID+0x280, map: [[0x2000, 2, 16]], taxels: [[1, 0, 0], [1, 1, 8]]}
- {number: 3, cob_id: $NODEID+0x380, map: [[0x2000, 3, 16]], taxels: [[2, 0, 0], [2, 1, 8]]}
'''


def tiny_layout(folder: Path, text: str = TINY):
    path = folder / 'layout.yaml'
    path.write_text(text)
    return load_layout(path)


class Loss(NamedTuple):
    """The number of CAN frames that a pad lost for one reason."""

    reason: LossReason
    can_frames: int = 1


def telling(assembler: PadAssembler, drop_incomplete: bool = False) -> PadAssembler:
    """Return the assembler, changed so that its calls return the lost CAN frames after the taxel frames."""
    def with_losses(call: Callable[..., TaxelFrames], *given: object) -> tuple[TaxelFrame | Loss, ...]:
        before, frames = assembler.facts().losses, taxel_frames(call(*given))
        after = assembler.facts().losses
        return (*frames, *(Loss(reason, after[reason] - before[reason]) for reason in after
                           if after[reason] > before[reason]))
    assembler.drop_incomplete = drop_incomplete
    for name in ('feed', 'sync', 'end_period'):
        setattr(assembler, name, partial(with_losses, getattr(assembler, name)))
    return assembler


def only(outcome: Sequence[TaxelFrame | Loss]) -> TaxelFrame | Loss | None:
    """Return the only result of a CAN frame or a SYNC, or None if there is no result."""
    assert len(outcome) <= 1, outcome
    return outcome[0] if outcome else None


def tally(assembler: PadAssembler) -> tuple[int, ...]:
    """Return the numbers of complete and incomplete frames, and of expected, received, used and pending TPDOs."""
    pad = assembler.facts()
    return (pad.frames_complete, pad.frames_incomplete, pad.tpdos_expected, pad.tpdos_received, pad.tpdos_used,
            pad.tpdos_pending)


def is_balanced(assembler) -> bool:
    """Return True if every CAN frame that the assembler has received is either used, pending or lost."""
    counts = assembler.facts()
    return (counts.tpdos_received == counts.tpdos_used + counts.tpdos_pending + sum(counts.losses.values())
            and counts.tpdos_used == sum(counts.used_by_node))


def taxel_frames(results: Sequence[TaxelFrame | Loss]) -> list[TaxelFrame]:
    return [result for result in results if isinstance(result, TaxelFrame)]


@contextmanager
def serial_line() -> Iterator[tuple[int, str]]:
    """Yield the file descriptor of the adapter's end of a pseudo-terminal, and the name of the port for the client."""
    adapter, client = pty.openpty()
    tty.setraw(client)
    try:
        yield adapter, os.ttyname(client)
    finally:
        os.close(adapter)
        os.close(client)


class Bench:
    """Context manager for a simulated skin and a driver on a virtual bus that no other test uses.

    ``wire`` is passed on to SkinSimulator.
    """

    def __init__(self, channel: str, layout: str = 'sim16x16.yaml', nodes: tuple[int, ...] = (32,),
                 source=None, wire: WireSettings | None = None, eds: str = '', **settings: Any):
        self.pads = with_dictionaries(make_pads([layout], nodes), [eds])
        rows, cols = self.pads[0].layout.rows, self.pads[0].layout.cols
        still = np.zeros((rows, cols))
        self.simulator = SkinSimulator(self.pads,
                                       {pad.name: source or (lambda t: still) for pad in self.pads}, wire=wire)
        self.channel = channel_of(channel)
        self.frames: queue.Queue[tuple[str, TaxelFrame]] = queue.Queue()
        self.log = CapturedLog()
        self.settings = BusSettings(INTERFACE, self.channel, **settings)
        self.driver = SkinBus(self.settings, self.pads,
                              lambda name, frame: self.frames.put((name, frame)))

    def __enter__(self) -> 'Bench':
        self.log.__enter__()
        self.simulator.start(INTERFACE, self.channel)
        return self

    def __exit__(self, *_: object) -> None:
        self.driver.close()
        self.simulator.stop()
        self.log.__exit__()

    def supervise(self) -> None:
        """Use a Supervisor as the driver instead of a SkinBus."""
        self.driver = Supervisor(self.settings, self.pads, lambda *given: self.frames.put(given))

    def run(self) -> None:
        self.driver.open()
        self.driver.configure()
        self.driver.start()

    def take(self, count: int) -> list:
        return [self.frames.get(timeout=60) for _ in range(count)]

    def take_whole(self, count: int) -> list:
        """Return the next complete frames.

        Incomplete frames are skipped, because some TPDOs arrive late on a busy machine.
        """
        frames = []
        while len(frames) < count:
            frames += [item for item in self.take(1) if item[1].missing_can_frames == 0]
        return frames

    def take_until(self, wanted: Callable[[TaxelFrame], bool]) -> TaxelFrame:
        """Return the next frame for which ``wanted`` returns True."""
        while not wanted(frame := self.take(1)[0][1]):
            pass
        return frame

    def forget(self) -> None:
        """Discard the frames in the queue. The driver must be stopped before its frames are discarded."""
        while not self.frames.empty():
            self.frames.get()
