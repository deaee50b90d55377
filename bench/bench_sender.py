"""The simulated skin as a sender: how late it hands over each frame, by the clock of its wire, and at what cost.

One pad of 16x16 taxels of 8 bits (32 TPDOs of 135 bits with the most stuff bits) behind a pseudo-terminal, on a wire of
1 Mbit/s, which 228 SYNCs a second fill. The client in this process sends SYNC and only counts what it reads.
"""

import argparse
import os
import select
import sys
import tempfile
import threading
import time
import tty
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from skin_process import SkinProcess

from tactile_node.simulator.wire import WireReport
from tactile_node.skin.pads import make_pad

NODE, LAYOUT = 32, 'sim16x16.yaml'
RATES = (185, 208, 228, 231)  #: SYNCs a second
COLUMNS = ('SYNC/s', 'frames/s', 'load %', 'busiest 0.1 s %', 'sweeps', 'skipped', 'read', 'late p50 ms', 'p99 ms',
           'max ms', 'CPU %')


class Client:
    """The skin's process, and the port that it has opened."""

    def __init__(self, folder: Path, options: list[str]):
        self._skin = SkinProcess(folder, LAYOUT, [NODE], options)
        self._port = os.open(self._skin.port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._port)
        self.read = 0
        self._is_ended = False
        self._reader = threading.Thread(target=self._count)

    def start(self) -> None:
        self._write('O')
        for number, tpdo in enumerate(make_pad('pad', NODE, LAYOUT).layout.tpdos):
            cob_id = tpdo.cob_id.of(NODE).to_bytes(4, 'little').hex()
            self._write(f't{0x600 + NODE:03X}823{number:02X}1801{cob_id}')
            time.sleep(0.003)
        self._write(f't000201{NODE:02X}')
        time.sleep(0.1)
        os.read(self._port, 1 << 16)
        self._reader.start()

    def play(self, rate: float, seconds: float) -> WireReport:
        self._skin.report()
        begin = time.monotonic()
        for number in range(1, round(rate * seconds) + 1):
            self._write('t0800')
            time.sleep(max(begin + number / rate - time.monotonic(), 0))
        return self._skin.report()

    def end(self) -> None:
        self._is_ended = True
        self._reader.join()
        self._skin.end()

    def _write(self, line: str) -> None:
        os.write(self._port, line.encode() + b'\r')

    def _count(self) -> None:
        while not self._is_ended:
            if select.select([self._port], [], [], 0.1)[0]:
                self.read += os.read(self._port, 1 << 16).count(b't')


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--seconds', type=float, default=8, help='for each rate, default %(default)s')
    parser.add_argument('options', nargs='*', help='of `tactile simulate`, after --')
    args = parser.parse_args()
    print('  '.join(COLUMNS))
    for rate in RATES:
        with tempfile.TemporaryDirectory() as folder:
            client = Client(Path(folder), args.options)
            client.start()
            report = client.play(rate, args.seconds)
            time.sleep(0.1)
            client.end()
        cells = (f'{rate:g}', f'{report.frames / report.seconds:.0f}', f'{100 * report.load:.1f}',
                 f'{100 * report.peak_load:.1f}', f'{report.sweeps}', f'{report.skipped}', f'{client.read}',
                 *(f'{1e3 * late:.2f}' for late in (report.late_p50, report.late_p99, report.late_max)),
                 f'{100 * report.cpu / report.seconds:.0f}')
        print('  '.join(cell.rjust(len(name)) for name, cell in zip(COLUMNS, cells)), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
