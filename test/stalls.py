"""Stalls of the skin, the adapter or the driver, each of which resumes afterwards.

The skin and its serial adapter run in a separate process.

`python test/stalls.py` starts the process of the skin and the adapter. Each taxel value encodes the SYNC that it
answers, so that a test can detect an old value with a current stamp. The process of the skin reads commands from its
standard input. The commands `hold` and `release` stop and resume the data flow from the adapter to the host. The
command `report` prints the time at which the skin answered each SYNC.
"""

import ctypes
import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import can
import numpy as np
from can_bench import TooSlowError
from captured_log import CapturedLog
from fault_bench import LAYOUT, PERIOD, PUNCTUAL, SYNC, TIMEOUT, Answers, Coded, check_stamps
from waiting import wait_until

from tactile_node.assembly.health import NodeFault
from tactile_node.bus import skin_bus
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.simulator.skin_simulator import SkinSimulator, WireSettings
from tactile_node.simulator.slcan_pty import SlcanPty
from tactile_node.skin.pads import LivePad, make_pads, with_dictionaries
from tactile_node.sources.supervisor import Supervisor
from tactile_node.taxel_frame import TaxelFrame

NODE_IDS = 32, 64
STALLING = 'skin', 'adapter', 'driver'
SETTLED = 2.5  #: Time within which a wrong report of two senders would appear [s].
SDO_TIMEOUT = 3.0  #: Time within which the skin answers on a busy machine [s].
ALLOWED = 1.5  #: Time limit from the end of a stall to the next taxels [s].


def pads() -> tuple[LivePad, ...]:
    return with_dictionaries(make_pads([LAYOUT], NODE_IDS))


class HeldUpAdapter(SlcanPty):
    """A serial adapter that can hold back data for the host and then send all of it at once."""

    def __init__(self) -> None:
        self._held: bytearray | None = None
        self._order = threading.RLock()  # later data must not overtake the data that is held back
        super().__init__()

    def hold(self) -> None:
        self._held = bytearray()

    def release(self) -> None:
        with self._order:
            held, self._held = self._held, None
            self._write(bytes(held))

    def _write(self, data: bytes) -> None:
        with self._order:
            if self._held is None:
                super()._write(data)
            else:
                self._held += data


class StallBench:
    """Context manager for two pads of 8x8 taxels, which records every published taxel frame."""

    def __init__(self) -> None:
        self.log = CapturedLog()
        self.kept: list[tuple[str, float, TaxelFrame]] = []  #: pad, time of publication [s, Unix epoch] and frame
        self.publishing_again: float | None = None  #: time from the end of the stall to the next frame [s]
        self.detected: float | None = None  #: not measured
        self.wrong_durations: list[str] = []  #: reported by `make faults` only, because a busy machine may be the cause
        self._asked: list[float] = []  # stamps of the SYNC messages that the driver wrote
        self._stalled = 0.0, 0.0  # start and end of the stall

    def __enter__(self) -> 'StallBench':
        self._skin = subprocess.Popen([sys.executable, __file__], text=True, stdin=subprocess.PIPE,
                                      stdout=subprocess.PIPE)
        port = self._skin.stdout.readline().strip()
        self._open_bus, skin_bus.open_bus = skin_bus.open_bus, self._open
        self.driver = Supervisor(BusSettings('slcan', port, sync_period=PERIOD, sdo_timeout=SDO_TIMEOUT), pads(),
                                 self._keep)
        self.log.__enter__()
        try:
            self.driver.open()
            self.driver.configure()
            self.driver.start()
            self._wait_for_whole(0.0)
            self._wait_for_no_fault()
        except BaseException:
            self._end(is_checked=False)
            raise
        return self

    def __exit__(self, *problem: object) -> None:
        self._end(is_checked=problem[0] is None)

    def _end(self, is_checked: bool) -> None:
        self.driver.close()
        skin_bus.open_bus = self._open_bus
        answered = self._answered() if is_checked else {}
        self._skin.kill()
        self._skin.wait()
        self._skin.stdout.close()
        self._skin.stdin.close()
        self.log.__exit__()
        if is_checked:
            self._check(answered)

    def stall(self, part: str, seconds: float) -> None:
        """Stop ``part`` of STALLING for ``seconds``, and wait until taxels arrive again."""
        begun = time.time()
        getattr(self, f'stalled_{part}')(seconds)
        self._stalled = begun, time.time()
        self.recover()

    def stalled_driver(self, seconds: float) -> None:
        """Stop this process, while the skin continues."""
        # This call holds the interpreter lock, so no other thread runs.
        ctypes.PyDLL(None).usleep(round(1e6 * seconds))

    def stalled_skin(self, seconds: float) -> None:
        """Stop the process of the skin, which then neither samples nor sends."""
        self._skin.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        self._skin.send_signal(signal.SIGCONT)

    def stalled_adapter(self, seconds: float) -> None:
        """Hold back all data to the host and then send it at once, while the skin and SYNC continue."""
        self._tell('hold')
        time.sleep(seconds)
        self._tell('release')

    def assert_in_time(self, holds: bool) -> None:
        """Assert ``holds``, provided that the skin answered in time.

        Raises TooSlowError if the skin was late because of the machine.
        """
        if not holds:
            late = [number for number, at in self._answered().items() if at - self._asked[number - 1] > PUNCTUAL]
            raise (TooSlowError if late else AssertionError)(
                f'{self.nodes}; {self.log.errors}; SYNCs answered late: {late}')

    def recover(self) -> None:
        """Wait until each pad has whole frames that were acquired after this call, and no fault remains."""
        ended = time.time()
        self._wait_for_whole(ended)
        self.publishing_again = max(min(at for name, at, frame in self.kept if name == pad and frame.stamp > ended
                                        and not frame.missing_can_frames and np.isfinite(frame.values).all()) - ended
                                    for pad in self._pads)
        self._wait_for_no_fault()

    @property
    def nodes(self) -> tuple:
        return tuple(node for pad in self.driver.facts().pads for node in pad.nodes)

    def wait_for_report(self, fault: NodeFault) -> None:
        assert wait_until(lambda: fault in self.faults, TIMEOUT), self.log.errors

    @property
    def faults(self) -> set[NodeFault]:
        """Faults logged so far."""
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

    def _open(self, *given: Any, **options: Any) -> can.BusABC:
        """Open the driver's bus, and record the stamp of each SYNC that the driver writes."""
        bus = self._open_bus(*given, **options)
        send = bus.send

        def noting(message: can.Message, timeout: float | None = None) -> None:
            send(message, timeout)
            if message.arbitration_id == SYNC:
                self._asked.append(message.timestamp)
        bus.send = noting
        return bus

    def _tell(self, line: str) -> None:
        print(line, file=self._skin.stdin, flush=True)

    def _answered(self) -> dict[int, float]:
        """Return the time at which the skin answered each SYNC, except for the SYNCs during the stall."""
        self._tell('report')
        begun, ended = self._stalled
        return {number: at for number, at in json.loads(self._skin.stdout.readline())
                if 0 < number <= len(self._asked) and not begun <= self._asked[number - 1] <= ended}

    def _check(self, answered: dict[int, float]) -> None:
        """Assert that no old value was published with a current stamp, and no current value with an old stamp."""
        for pad in self._pads:
            check_stamps([frame for name, _, frame in self.kept if name == pad], Coded(), self._asked, answered)


def stall(part: str, seconds: float) -> Callable[[str], StallBench]:
    """Return a fault for the catalogue in which ``part`` of STALLING stops for ``seconds``."""
    def fault(_channel: str) -> StallBench:
        with StallBench() as bench:
            bench.stall(part, seconds)
            time.sleep(SETTLED)
            bench.assert_in_time(NodeFault.TWO_SENDERS not in bench.faults)
            if part == 'driver':
                bench.assert_in_time(not bench.faults)
            elif seconds >= 1.0:
                bench.wait_for_report(NodeFault.SILENT)
                nodes = bench.nodes
                bench.assert_in_time(all(node.outage_last_reason is NodeFault.SILENT for node in nodes))
                bench.wrong_durations += [f'an outage of {node.outage_seconds:.2f} s' for node in nodes
                                          if not seconds - 0.5 < node.outage_seconds < seconds + ALLOWED]
        return bench
    fault.__name__ = f'{part}_stalls_for_{seconds:g}_s'
    fault.__doc__ = {'skin': 'The skin is reported as silent. Its old values are not published as current values.',
                     'adapter': 'The data that the adapter held back is counted as late, and as data of one device.',
                     'driver': 'This process did not run. No device is reported as faulty or configured again.'}[part]
    return fault


def main() -> None:
    adapter, coded, simulated = HeldUpAdapter(), Coded(), pads()
    simulator = SkinSimulator(simulated, {pad.name: coded for pad in simulated}, wire=WireSettings())
    simulator.start_on(adapter)
    answers = Answers(simulator, coded, simulated)
    print(adapter.port, flush=True)
    for line in sys.stdin:
        match line.strip():
            case 'hold':
                adapter.hold()
            case 'release':
                adapter.release()
            case 'report':
                print(json.dumps(list(answers.at.items())), flush=True)


if __name__ == '__main__':
    main()
