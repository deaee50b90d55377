"""Run two pads at full bus load for a long time, and record lost TPDOs, memory and the latency from SYNC to frame.

Run `make soak` (`make soak MINUTES=60`), or: python bench/soak.py [--minutes 10] [--rate 115]

- The simulated skin runs in a separate process behind a pseudo-terminal, like a serial CAN adapter (slcan). The skin
  sends each CAN frame at the time at which a real bus would have carried it. The columns about the skin show the bus
  load, how late the frames were sent, and the skin's CPU load.
- The script runs the same supervised driver as the driver node. The driver accepts such a full bus only with the
  setting ``allow_full_bus``.
- At 115 sweeps per second, two 8-bit pads of 16x16 taxels fill a bus of 1 Mbit/s: each sweep has 64 TPDOs of 135 bits,
  with the largest number of stuff bits. Heartbeats and SDOs use the bus as well, so a device sometimes skips a sweep
  ("sweeps skipped").
- If the system permits, all processes run at a raised priority, like the drivers on a robot.
- A third process repeatedly sleeps for one millisecond, and reports the longest time for which the machine stalled.

The script writes soak.csv. The exit code is 1 if any transmitted TPDO was lost or arrived too late.
"""

import argparse
import csv
import gc
import json
import logging
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from array import array
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ[f'{library}_NUM_THREADS'] = '1'  # numpy reads these variables when it is imported
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np

from tactile_node.bus.bus_settings import BusSettings
from tactile_node.simulator.wire import WireReport
from tactile_node.skin.pads import make_pad
from tactile_node.sources.log_source import summary
from tactile_node.sources.supervisor import Supervisor
from tactile_node.taxel_frame import TaxelFrame

NODES = (32, 64)  #: Node-IDs of the two pads.
LAYOUT = 'sim16x16.yaml'
TPDOS = 32        #: Number of TPDOs in a sweep of one node.
FULL_LOAD = 115.0  #: Sweeps per second that fill the bus.
PERCENTILES = (50, 99, 99.9, 100)
SENDER_LATE = ('p50', 'p99', 'max')
NAP = 1e-3  #: Duration of each sleep of StallWatch [s].
REPORT_TIMEOUT = 10.0  #: Longest wait for a report from the skin [s].
NICE = -10  #: Nice value of the driver and the skin.
COLUMNS = ('minutes', 'taxel frames', 'of these incomplete', 'TPDOs not received', 'TPDOs lost', 'bus load %',
           'machine still ms', *(f'latency p{p:g} ms' for p in PERCENTILES), 'memory MB', 'driver CPU %',
           'wire load %', 'busiest 0.1 s %', 'sweeps skipped', 'not read',
           *(f'sender late {p} ms' for p in SENDER_LATE), 'sender CPU %')


class Row(NamedTuple):
    """Results and counts for one time window."""

    minutes: float
    frames: int
    incomplete: int
    missing: int  #: TPDOs that were expected in this window but not received
    lost: int     #: TPDOs that arrived too late or were unusable for another reason
    load: float
    stall: float  #: longest stall of the process that only sleeps [ms]
    latency: tuple[float, ...]  #: latencies at PERCENTILES [ms]
    memory: float               #: resident memory of the process with the driver [MB]
    cpu: float                  #: CPU load of the process with the driver [cores]
    sender: WireReport

    def cells(self) -> list[str]:
        return [f'{self.minutes:.2f}', f'{self.frames}', f'{self.incomplete}', f'{self.missing}', f'{self.lost}',
                f'{self.load:.1f}', f'{self.stall:.1f}',
                *(f'{value:.2f}' for value in self.latency), f'{self.memory:.1f}', f'{100 * self.cpu:.0f}',
                *self._sender_cells()]

    def _sender_cells(self) -> list[str]:
        sender = self.sender
        return [f'{100 * sender.load:.1f}', f'{100 * sender.peak_load:.1f}', f'{sender.skipped}', f'{sender.lost}',
                *(f'{1e3 * late:.2f}' for late in (sender.late_p50, sender.late_p99, sender.late_max)),
                f'{100 * sender.cpu / sender.seconds:.0f}']


class SkinProcess:
    """The simulated skin, which runs until ``end`` is called. ``port`` is the port of the simulated adapter."""

    def __init__(self, folder: Path, layout: str, nodes: Sequence[int]):
        self.port, self._file = str(folder / 'can'), folder / 'wire.jsonl'
        command = [sys.executable, '-m', 'tactile_node.cli.main', 'simulate', '--pty', '--link', self.port, '--layout',
                   layout, '--node-id', ','.join(map(str, nodes)), '--report', str(self._file)]
        self._process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        self._reports = 0
        if not self._process.stdout or not self._process.stdout.readline():
            sys.exit('the simulated skin has not started')

    def report(self) -> WireReport:
        """Return a report about the bus traffic since the previous call."""
        self._process.send_signal(signal.SIGUSR1)
        end = time.monotonic() + REPORT_TIMEOUT
        while time.monotonic() < end:
            lines = self._file.read_text(encoding='utf-8').split('\n') if self._file.exists() else []
            if len(lines) - 1 > self._reports:
                self._reports = len(lines) - 1
                return WireReport(**json.loads(lines[-2]))
            time.sleep(0.01)
        sys.exit('the simulated skin does not report')

    def end(self) -> None:
        self._process.terminate()
        self._process.wait()


class Latencies:
    """Collects the latencies from SYNC to the arrival of a taxel frame [s] until the next call of ``take``."""

    def __init__(self):
        self._taken, self._lock = array('d'), threading.Lock()

    def __call__(self, name: str, frame: TaxelFrame) -> None:
        with self._lock:
            self._taken.append(time.time() - frame.stamp)

    def take(self) -> np.ndarray:
        with self._lock:
            taken, self._taken = self._taken, array('d')
        return np.array(taken)


class StallWatch:
    """A process that only sleeps. ``take`` returns the longest stall since the last call [s]."""

    def __init__(self):
        context = multiprocessing.get_context('fork')  # fork before any thread starts
        self._longest = context.Value('d', 0.0)
        self._process = context.Process(target=self._watch, daemon=True)
        self._process.start()

    def take(self) -> float:
        with self._longest:
            longest, self._longest.value = self._longest.value, 0.0
        return longest

    def end(self) -> None:
        self._process.terminate()
        self._process.join()

    def _watch(self) -> None:
        before = time.monotonic()
        while True:
            time.sleep(NAP)
            now = time.monotonic()
            with self._longest:
                self._longest.value = max(self._longest.value, now - before - NAP)
            before = now


class Soak:
    """A running driver with the measured rows of the table."""

    def __init__(self, driver: Supervisor, latencies: Latencies, stalls: StallWatch, skin: SkinProcess):
        self.driver = driver
        self._skin = skin
        self._latencies = latencies
        self._stalls = stalls
        self.rows: list[Row] = []
        stalls.take()
        skin.report()
        self._begin, self._before = time.monotonic(), np.zeros(4, int)
        self._cpu, self._row_begin = time.process_time(), self._begin

    def row(self) -> Row:
        facts = self.driver.facts()
        counts = np.array([(pad.published, pad.frames_incomplete, max(pad.tpdos_expected - pad.tpdos_received, 0),
                            sum(pad.losses.values())) for pad in facts.pads]).sum(0)
        (frames, incomplete, missing, lost), self._before = counts - self._before, counts
        taken = self._latencies.take()
        latency = tuple(np.percentile(taken, PERCENTILES) * 1e3) if len(taken) else (np.nan,) * len(PERCENTILES)
        self.rows.append(Row(minutes=(time.monotonic() - self._begin) / 60, frames=frames, incomplete=incomplete,
                             missing=missing, lost=lost, load=100 * facts.bus_load,
                             stall=1e3 * self._stalls.take(), latency=latency, memory=resident(),
                             cpu=self._cpu_share(), sender=self._skin.report()))
        return self.rows[-1]

    def _cpu_share(self) -> float:
        cpu, now = time.process_time(), time.monotonic()
        share = (cpu - self._cpu) / (now - self._row_begin)
        self._cpu, self._row_begin = cpu, now
        return share

    @property
    def growth(self) -> float:
        """Growth of the memory after the warm-up, which is the first tenth of the run [MB]."""
        memory = [row.memory for row in self.rows]
        return memory[-1] - memory[len(memory) // 10]


def resident() -> float:
    return int(Path('/proc/self/statm').read_text().split()[1]) * os.sysconf('SC_PAGE_SIZE') / 1e6


def priority() -> str:
    """Raise the priority of this process and its future children if permitted, and describe the result."""
    try:
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
    except PermissionError:
        return f'normal, because nice {NICE} is not allowed here'
    return f'nice {NICE}, driver and skin'


def run(args: argparse.Namespace, skin: SkinProcess, stalls: StallWatch) -> Soak:
    latencies = Latencies()
    pads = tuple(make_pad(f'pad{node}', node, LAYOUT) for node in NODES)
    settings = BusSettings('slcan', skin.port, sync_period=1 / args.rate, allow_full_bus=True)
    driver = Supervisor(settings, pads, latencies)
    driver.open()
    try:
        driver.configure()
        driver.start()
        gc.freeze()  # freeze existing objects, as the driver node does
        soak, windows = Soak(driver, latencies, stalls, skin), max(round(args.minutes * 60 / args.window), 1)
        for number in range(1, windows + 1):
            time.sleep(max(soak._begin + number * args.window - time.monotonic(), 0))
            print('  '.join(cell.rjust(len(name)) for name, cell in zip(COLUMNS, soak.row().cells())), flush=True)
        driver.stop()
        print(summary(driver.facts()))
        return soak
    finally:
        driver.close()


def write(folder: Path, rows: list[Row]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / 'soak.csv').open('w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerows([COLUMNS, *(row.cells() for row in rows)])


def main() -> int:
    args = _arguments()
    logging.basicConfig(level=logging.INFO, format='%(message)s', stream=sys.stdout)
    print(f'priority: {priority()}')
    stalls = StallWatch()
    with tempfile.TemporaryDirectory() as folder:
        skin = SkinProcess(Path(folder), LAYOUT, NODES)
        try:
            print(f'two pads, {args.rate:g} sweeps/s each, {args.minutes:g} minutes; full load is {FULL_LOAD:g}, '
                  'which the driver accepts only with allow_full_bus')
            print('  '.join(COLUMNS), flush=True)
            soak = run(args, skin, stalls)
        finally:
            skin.end()
            stalls.end()
    write(args.output, soak.rows)
    missing, lost = sum(row.missing for row in soak.rows), sum(row.lost for row in soak.rows)
    skipped = sum(row.sender.skipped for row in soak.rows) * TPDOS
    print(f'TPDOs not received: {missing}, not sent by the device: {skipped}; received and lost: {lost}; '
          f'memory growth after the first tenth: {soak.growth:+.1f} MB; table in {args.output}')
    return int(missing + lost > skipped)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--minutes', type=float, default=10, help='duration in minutes, default %(default)s')
    parser.add_argument('--rate', type=float, default=FULL_LOAD, help='sweeps per second, default %(default)s')
    parser.add_argument('--window', type=float, default=10,
                        help='duration of a row of the table [s], default %(default)s')
    parser.add_argument('--output', type=Path, default=ROOT / 'bench_output')
    return parser.parse_args()


if __name__ == '__main__':
    sys.exit(main())
