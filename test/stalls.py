"""Skin, adapter or driver stall and go on: a skin in its own process, behind a serial line that can be held up.

`python test/stalls.py` is the skin. Its taxels show when they were sampled, so that a value of the past under a
present stamp is found. CAN frames on its standard input, as `185#01020304`, are those of another device beside it.
"""

import ctypes
import os
import pty
import select
import signal
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable

import numpy as np
from can_bench import wait_until
from captured_log import CapturedLog
from fault_bench import LAYOUT, SIDE, TIMEOUT, WIRE

from tactile_node.assembly.health import NodeFault
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.slcan_pty import SlcanPty
from tactile_node.skin.pads import make_pads, with_dictionaries
from tactile_node.sources.supervisor import Supervisor
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus

NODE_IDS = 32, 64
STALLING = 'skin', 'adapter', 'driver'
TAXEL, TICK = 0.2, 0.001  # N from one taxel to the next, N for each RESOLUTION of time
RESOLUTION, CYCLE = 0.01, 160.0  # s
#: s by which a value may be older or newer than its stamp: a period, and what the wire and two busy cores add
TOLERANCE = 0.06
SETTLED = 2.5  # s in which a wrong report of two senders would follow
ALLOWED = 1.5  # s from the end of a stall until taxels come again
PLACE = TAXEL * np.arange(SIDE * SIDE).reshape(SIDE, SIDE)


def sample(_time: float) -> np.ndarray:
    """Taxels [N] that show their place and the time of day."""
    return PLACE + TICK * (time.time() % CYCLE // RESOLUTION)


def error_of_stamp(frame: TaxelFrame) -> float | None:
    """By how much the stamp is later than the sampling of its valid taxels [s]; None where none is valid."""
    valid = frame.status == TaxelStatus.VALID
    if not valid.any():
        return None
    ticks = (frame.values[valid] - PLACE[valid]) / TICK
    np.testing.assert_allclose(ticks, np.round(ticks[0]), atol=0.6)  # of one sample
    return (frame.stamp - float(ticks[0]) * RESOLUTION + CYCLE / 2) % CYCLE - CYCLE / 2


class Line:
    """A serial line from the adapter on ``port`` to ``self.port``; what it carries to the host can be held back."""

    def __init__(self, port: str):
        self._skin = os.open(port, os.O_RDWR | os.O_NOCTTY)
        self._master, self._slave = pty.openpty()
        tty.setraw(self._skin)
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self.is_held = threading.Event()
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ends.set()
        self._thread.join(TIMEOUT)
        for descriptor in (self._skin, self._master, self._slave):
            os.close(descriptor)

    def _run(self) -> None:
        to_host = bytearray()
        os.set_blocking(self._master, False)
        while not self._ends.is_set():
            is_writable = bool(to_host) and not self.is_held.is_set()
            readable, writable, _ = select.select([self._skin, self._master], [self._master] * is_writable, [], 0.01)
            if self._master in readable:
                os.write(self._skin, os.read(self._master, 4096))
            if self._skin in readable:
                to_host += os.read(self._skin, 4096)
            if writable:
                del to_host[:os.write(self._master, to_host)]


class StallBench:
    """Two pads of 8x8 taxels; every taxel frame published is kept. Use with ``with``."""

    def __init__(self) -> None:
        self.log = CapturedLog()
        self.kept: list[tuple[str, float, TaxelFrame]] = []  #: pad, when [s, Unix epoch], frame
        self.publishing_again: float | None = None  #: s after the end of the stall
        self.detected: float | None = None  #: not measured

    def __enter__(self) -> 'StallBench':
        self._skin = subprocess.Popen([sys.executable, __file__], text=True, stdin=subprocess.PIPE,
                                      stdout=subprocess.PIPE)
        self._line = Line(self._skin.stdout.readline().strip())
        pads = with_dictionaries(make_pads([LAYOUT], NODE_IDS))
        self.driver = Supervisor(BusSettings('slcan', self._line.port, sync_period=0.02), pads, self._keep)
        self.log.__enter__()
        self.driver.open()
        self.driver.configure()
        self.driver.start()
        self._wait_for_whole(0.0)
        self._wait_for_no_fault()
        return self

    def __exit__(self, *problem: object) -> None:
        self.driver.close()
        self._line.close()
        self._skin.kill()
        self._skin.wait()
        self._skin.stdout.close()
        self._skin.stdin.close()
        self.log.__exit__()
        if problem[0] is None:
            self._check()

    def stalled_driver(self, seconds: float) -> None:
        """This process does not run, the skin does."""
        ctypes.PyDLL(None).usleep(round(1e6 * seconds))  # keeps the interpreter's lock: no thread runs

    def stalled_skin(self, seconds: float) -> None:
        """The skin's process does not run: nothing is sampled, nothing is answered."""
        self._skin.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        self._skin.send_signal(signal.SIGCONT)

    def stalled_adapter(self, seconds: float) -> None:
        """Skin and SYNC go on; what the host should receive comes afterwards, all at once."""
        self._line.is_held.set()
        time.sleep(seconds)
        self._line.is_held.clear()

    def send(self, can_id: int, data: str) -> None:
        """Let another device beside the skin send a frame, when its turn on the wire comes."""
        print(f'{can_id:X}#{data}', file=self._skin.stdin, flush=True)

    def recover(self) -> None:
        """Wait until each pad gives whole frames that were acquired from now on, and no fault stays."""
        ended = time.time()
        self._wait_for_whole(ended)
        self.publishing_again = max(min(at for name, at, frame in self.kept if name == pad and frame.stamp > ended
                                        and not frame.missing_can_frames and np.isfinite(frame.values).all()) - ended
                                    for pad in self._pads)
        self._wait_for_no_fault()

    @property
    def nodes(self) -> tuple:
        return tuple(node for nodes in self.driver.health().nodes.values() for node in nodes)

    def wait_for_report(self, fault: NodeFault) -> None:
        assert wait_until(lambda: fault in self.faults, TIMEOUT), self.log.errors

    @property
    def faults(self) -> set[NodeFault]:
        """Those that were logged."""
        return {fact for fact in self.log.facts if isinstance(fact, NodeFault)}

    @property
    def _pads(self) -> tuple[str, ...]:
        return tuple(f'pad{node_id}' for node_id in NODE_IDS)

    def _wait_for_whole(self, after: float) -> None:
        def has_come(pad: str) -> bool:
            return any(name == pad and frame.stamp > after and np.isfinite(frame.values).all()
                       for name, _, frame in self.kept[-20:])
        assert wait_until(lambda: all(map(has_come, self._pads)), TIMEOUT), (self.nodes, self.log.errors)

    def _wait_for_no_fault(self) -> None:
        assert wait_until(lambda: all(node.fault is NodeFault.NONE for node in self.nodes), TIMEOUT), self.nodes

    def _keep(self, name: str, frame: TaxelFrame) -> None:
        self.kept.append((name, time.time(), frame))

    def _check(self) -> None:
        """No value of the past was published under a present stamp, nor the other way round."""
        errors = [error for _, _, frame in self.kept if (error := error_of_stamp(frame)) is not None]
        wrong = [error for error in errors if abs(error) > TOLERANCE]
        assert not wrong, f'{len(wrong)} of {len(errors)} frames with valid taxels: stamps late by {wrong[:20]} s'


def stall(part: str, seconds: float) -> Callable[[str], StallBench]:
    """A fault of the catalogue: ``part`` of STALLING does not run for so long."""
    def fault(_channel: str) -> StallBench:
        with StallBench() as bench:
            getattr(bench, f'stalled_{part}')(seconds)
            bench.recover()
            time.sleep(SETTLED)
            assert NodeFault.TWO_SENDERS not in bench.faults, bench.log.errors
            if part == 'driver':
                assert not bench.faults, bench.log.errors
            elif seconds >= 1.0:
                bench.wait_for_report(NodeFault.SILENT)
                outages = [node.outages for node in bench.nodes]
                assert all(one.cause is NodeFault.SILENT and seconds - 0.5 < one.seconds < seconds + ALLOWED
                           for one in outages), outages
        return bench
    fault.__name__ = f'{part}_stalls_for_{seconds:g}_s'
    fault.__doc__ = {'skin': 'The skin is reported as silent; its values of before are not given as present ones.',
                     'adapter': 'What the adapter held back is of the past: counted as late, of one device.',
                     'driver': 'This process did not run: no device is blamed for it, none is configured again.'}[part]
    return fault


def main() -> None:
    adapter = SlcanPty()
    simulator = SkinSimulator(with_dictionaries(make_pads([LAYOUT], NODE_IDS)),
                              {f'pad{node_id}': sample for node_id in NODE_IDS}, wire=WIRE)
    simulator.start_on(adapter)
    print(adapter.port, flush=True)
    other = simulator._gateway.network(5) if WIRE else simulator._network
    for line in sys.stdin:
        can_id, data = line.split('#')
        other.send_message(int(can_id, 16), bytes.fromhex(data))


if __name__ == '__main__':
    main()
