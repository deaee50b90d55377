"""Writes the CAN logs of test/data: ``python tools/make_test_logs.py FOLDER_OF_NUS_RECORDINGS``.

The real driver meets the simulated skin on a virtual bus, as in a live session: boot-up, SDO, NMT, SYNC,
TPDOs. Only time is made, not measured: each SYNC stands at its poll's stamp and the frames after it follow at
the pace of a 1 Mbit/s bus, so that the logs look like a real bus's and come out the same on a slow machine.
"""

import gzip
import io
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import can
import numpy as np

from tactile_node.bus.skin_bus import BusSettings, SkinBus
from tactile_node.cia301.objects import HEARTBEAT, SYNC, NmtState
from tactile_node.simulator.device import TaxelSource
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.touches import load_recording, touch_program
from tactile_node.simulator.world import CLASSES
from tactile_node.skin.pads import LivePad, make_pad

DATA = Path(__file__).resolve().parents[1] / 'test' / 'data'
EPOCH = 1_700_000_000.0  # s: the logs' beginning, a date of no meaning
FRAME_TIME = 135e-6  # s: a worst-case stuffed 8-byte frame at 1 Mbit/s
BOOT_TIME = 2.0  # s from the log's beginning to the first SYNC


def main() -> None:
    recordings = Path(sys.argv[1])
    ring = load_recording(recordings / 'ciclerecording.txt')
    square = load_recording(recordings / 'square_moving.txt')
    moved = slice(1, 201)  # from the first contact on, 12 s
    nus = [make_pad('pad', 32, 'nus_sinapse_64x64.yaml')]
    session(DATA / 'nus_ring_session.log.gz', nus, ring.stamps, replayed(nus, ring.frames))
    session(DATA / 'nus_square_excerpt.log.gz', nus, square.stamps[moved],
            replayed(nus, square.frames[moved]))
    gripper = [make_pad('left', 32, 'sim16x16.yaml'), make_pad('right', 64, 'sim16x16.yaml')]
    stamps, sources = five_shapes(gripper)
    session(DATA / 'sim16x16_two_pads.log.gz', gripper, stamps, sources)


def replayed(pads: list[LivePad], frames: np.ndarray) -> dict[str, TaxelSource]:
    """Each SYNC's frame in turn, whatever the time."""
    return {pad.name: partial(_next, iter(frames.astype(float))) for pad in pads}


def five_shapes(pads: list[LivePad]) -> tuple[np.ndarray, dict[str, TaxelSource]]:
    """25 Hz; every shape touches once, the right pad sees it mirrored."""
    program = touch_program(pads[0].layout, CLASSES, areas=(60,), seed=2, hold=0.6, pause=0.3)
    times = np.arange(0, program.duration, 0.04)
    left = [program(t) for t in times]
    return times, {name: partial(_next, iter(frames))
                   for name, frames in (('left', left), ('right', [frame[:, ::-1] for frame in left]))}


def _next(frames: Iterator[np.ndarray], _time: float) -> np.ndarray:
    return next(frames)


def session(path: Path, pads: list[LivePad], stamps: np.ndarray, sources: dict[str, TaxelSource]) -> None:
    """Record boot-up, configuration and one SYNC for each of ``stamps`` [s] as candump log."""
    arrived = threading.Semaphore(0)
    wire, recorded = can.Bus('session', interface='virtual', receive_own_messages=True), []
    notifier = can.Notifier(wire, [recorded.append], 0.05)
    simulator = SkinSimulator(pads, sources)
    driver = SkinBus(BusSettings('virtual', 'session', produce_sync=False), tuple(pads),
                     lambda *_: arrived.release())
    simulator.start('virtual', 'session')
    driver.open()
    driver.configure()
    driver.start()
    for _ in stamps:
        wire.send(can.Message(arbitration_id=SYNC, is_extended_id=False))
        for _ in pads:
            if not arrived.acquire(timeout=5):
                raise RuntimeError('a taxel frame is missing')
    driver.close()
    simulator.stop()
    expected = len(stamps) * sum(len(pad.layout.tpdos) for pad in pads)
    wait_for(lambda: sum(0x180 <= m.arbitration_id < 0x580 for m in recorded) == expected)
    notifier.stop()
    wire.shutdown()
    write(path, timed(recorded, stamps, [node_id for pad in pads for node_id in pad.node_ids]))
    print(f'{path.name}: {len(recorded)} CAN frames, {path.stat().st_size / 1e3:.0f} kB')


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 5
    while not condition():
        if time.monotonic() > end:
            raise RuntimeError('the recording is not whole')
        time.sleep(0.01)


def timed(recorded: list[can.Message], stamps: np.ndarray, nodes: list[int]) -> list[can.Message]:
    """Give the messages made times, and heartbeats at the period that the driver has set."""
    syncs = iter(stamps - stamps[0] + EPOCH + BOOT_TIME)
    now = EPOCH
    timed_messages = []
    for message in recorded:
        is_heartbeat = message.arbitration_id >> 7 == HEARTBEAT >> 7
        if is_heartbeat and message.data[0] != NmtState.BOOT_UP:
            continue  # their number depends on the speed of the machine; see below
        now = next(syncs) if message.arbitration_id == SYNC else now + FRAME_TIME
        message.timestamp = now
        message.channel = 'can0'
        message.is_rx = True
        timed_messages.append(message)
    beats = np.arange(EPOCH + BOOT_TIME, now, BusSettings('', '').heartbeat_ms * 1e-3)
    timed_messages += [heartbeat(beat, node) for beat in beats for node in nodes]
    return sorted(timed_messages, key=lambda message: message.timestamp)


def heartbeat(stamp: float, node: int) -> can.Message:
    return can.Message(stamp, HEARTBEAT + node, is_extended_id=False, data=[NmtState.OPERATIONAL], channel='can0')


def write(path: Path, messages: list[can.Message]) -> None:
    with gzip.GzipFile(path, 'wb', mtime=0) as compressed:  # the same bytes from the same messages
        writer = can.CanutilsLogWriter(io.TextIOWrapper(compressed, encoding='ascii'))
        for message in messages:
            writer.on_message_received(message)
        writer.stop()


if __name__ == '__main__':
    main()
