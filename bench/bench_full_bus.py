"""The driver at the limit of the wire, over slcan: processor time against other readers, whole sweeps, latency.

One pad of 16x16 taxels of 8 bits: 32 TPDOs of 135 bits with the most stuff bits, which 228 SYNCs a second fill at
1 Mbit/s. The simulated skin is a separate process that sends each frame when the wire has carried it; each reader is
one, too, and sends SYNC:

    driver     the supervised driver, to taxel frames
    bare       python-can's slcan in its Notifier, which only counts
    pdo maps   canopen's RemoteNode: its PdoMaps, with a callback for each

    python bench/bench_full_bus.py [--seconds 8] [--batch 0.0005] [--against OTHER/TREE]

--against measures the driver of another checkout by turns with this one. --batch: for how long the adapter gathers CAN
frames before it hands them over [s]; 0: each alone. The latency of the last frame of a sweep is from its end on the
wire to the taxel frame in hand, the adapter included.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ[f'{library}_NUM_THREADS'] = '1'  # read when numpy is imported

NODE, LAYOUT = 32, 'sim16x16.yaml'
RATES = (185, 208, 217, 224, 231)  #: SYNCs a second
FULL = 224
SWEEP = (32 * 135 + 55) * 1e-6  #: s of wire
DELAY = 0.0003  #: s from SYNC to the first TPDO, of the simulated skin
LOGGED = 20.0  #: s of the log that is replayed
WARM = 1.0  #: s before a measurement


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--seconds', type=float, default=8.0, help='of each row, default %(default)s')
    parser.add_argument('--batch', type=float, default=0.0005, metavar='S', help='of the adapter, default %(default)s')
    parser.add_argument('--against', type=Path, metavar='TREE', help='another checkout')
    parser.add_argument('--reader', nargs=4, metavar=('KIND', 'PORT', 'LAYOUT', 'RATE'), help='be one; as JSON')
    args = parser.parse_args()
    if args.reader:
        kind, port, layout, rate = args.reader
        print(json.dumps(READERS[kind](port, layout, float(rate), args.seconds)))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder), args.seconds, args.batch)
        trees = {'here': ROOT} | ({'there': args.against.resolve()} if args.against else {})
        print(f'processor time at {FULL} SYNCs a second')
        bare = bench.row('bare', FULL, ROOT)
        bench.row('pdo maps', FULL, ROOT, bare)
        for name, tree in trees.items():
            bench.row('driver', FULL, tree, bare, name)
        print('replay as fast as possible, to taxel frames: times a full bus')
        for name, tree in trees.items():
            bench.replay(tree, name)
        print('whole sweeps')
        for rate in RATES:
            for name, tree in trees.items():
                bench.row('driver', rate, tree, bare, name)
    return 0


class Bench:
    """Runs a reader in its process against the skin in its own."""

    def __init__(self, folder: Path, seconds: float, batch: float):
        self._options = ['--batch', str(batch)]
        self._folder = folder
        self._seconds = seconds

    def replay(self, tree: Path, name: str) -> None:
        """Print how much faster than a full bus the driver of ``tree`` plays a log of LOGGED seconds."""
        log = self._folder / 'full.log'
        if not log.exists():
            write_log(log)
        command = [sys.executable, __file__, '--reader', 'replay', str(log), LAYOUT, str(FULL)]
        found = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True,
                                          env=os.environ | {'PYTHONPATH': str(tree)}).stdout)
        print(f'  {name:5}: {LOGGED / found["cpu"]:.1f} on one core ({found["whole"]} sweeps)', flush=True)

    def row(self, kind: str, rate: float, tree: Path, bare: float = 0.0, name: str = 'here') -> float:
        """Print one; its processor time [cores]."""
        with tempfile.TemporaryDirectory(dir=self._folder) as folder:
            skin = SkinProcess(Path(folder), LAYOUT, [NODE], self._options)
            command = [sys.executable, __file__, '--seconds', str(self._seconds), '--reader', kind, skin.port,
                       LAYOUT, str(rate)]
            reader = subprocess.Popen(command, stdout=subprocess.PIPE, text=True,
                                      env=os.environ | {'PYTHONPATH': str(tree)})
            assert reader.stdout
            assert reader.stdout.readline(), 'the reader has not started'
            skin.report()
            found = json.loads(reader.stdout.readline())
            wire = skin.report()
            reader.wait()
            skin.end()
        ratio = f' ({found["cpu"] / bare:4.2f} x bare)' if bare else ''
        whole = ''
        if 'whole' in found:
            p50, p99 = found['latency']
            whole = (f'; {found["whole"]} of {wire.sweeps - wire.skipped} sweeps whole, {wire.skipped} skipped, '
                     f'{found["lost"]}, {found["pauses"]} SYNCs left out; last frame to taxels {p50:.2f} ms, '
                     f'99 % {p99:.2f} ms')
        print(f'  {kind:8} {name:5} {rate:4.0f}/s, load {100 * wire.load:5.1f} %: {found["cpu"]:.2f} cores{ratio}'
              f'{whole}; sender {wire.cpu / wire.seconds:.2f} cores, late by {1e3 * wire.late_p99:.1f} ms (99 %)',
              flush=True)
        return found['cpu']


def measured(seconds: float) -> float:
    """Wait so long, with the parent's report at the beginning; the processor time that this process takes [cores]."""
    time.sleep(WARM)
    print('measuring', flush=True)
    begun, cpu = time.monotonic(), time.process_time()
    time.sleep(seconds)
    return (time.process_time() - cpu) / (time.monotonic() - begun)


def driver(port: str, layout: str, rate: float, seconds: float) -> dict:
    from tactile_node.bus.bus_settings import BusSettings
    from tactile_node.skin.pads import make_pad
    from tactile_node.sources.supervisor import Supervisor
    latencies: list[float] = []

    def received(_name: str, frame) -> None:
        if not frame.missing_can_frames:
            latencies.append(time.time() - frame.stamp - DELAY - SWEEP)
    full = {'allow_full_bus': True} if hasattr(BusSettings, 'allow_full_bus') else {}  # an older tree has it not
    bus = Supervisor(BusSettings('slcan', port, sync_period=1 / rate, **full), (make_pad('pad', NODE, layout),),
                     received)
    bus.open()
    bus.configure()
    bus.start()
    before = None

    def note() -> None:
        nonlocal before
        before = bus.statistics()
        latencies.clear()
    threading.Timer(WARM, note).start()
    cpu = measured(seconds)
    whole, taken, after = len(latencies), sorted(latencies), bus.statistics()
    bus.close()
    lost = {reason.key: count - before.pads['pad'].losses[reason] for reason, count in after.pads['pad'].losses.items()
            if count > before.pads['pad'].losses[reason]}
    return {'cpu': cpu, 'whole': whole, 'lost': lost or 'none lost',
            'pauses': getattr(after, 'sync_pauses', 0) - getattr(before, 'sync_pauses', 0),
            'latency': [1e3 * taken[int(share * (whole - 1))] for share in (0.5, 0.99)]}


def write_log(path: Path) -> None:
    """A candump log of LOGGED seconds of a full bus."""
    tpdos = load_layout(LAYOUT).tpdos
    with path.open('w', encoding='ascii') as stream:
        for number in range(round(LOGGED * FULL)):
            at = 1e9 + number / FULL
            stream.write(f'({at:.6f}) can0 080#\n')
            for place, tpdo in enumerate(tpdos):
                stream.write(f'({at + DELAY + place * 135e-6:.6f}) can0 {tpdo.cob_id.of(NODE):03X}#'
                             f'{number % 256:02X}{8 * place % 256:02X}405060708090\n')


def replay(log: str, layout: str, _rate: float, _seconds: float) -> dict:
    from tactile_node.skin.pads import make_pad
    from tactile_node.sources.log_source import LogSource
    whole = []
    source = LogSource(log, (make_pad('pad', NODE, layout),),
                       lambda name, frame: whole.append(not frame.missing_can_frames), pace=None)
    source.open()
    cpu = time.process_time()
    source.start()
    source.finished.wait()
    cpu = time.process_time() - cpu
    source.close()
    return {'cpu': cpu, 'whole': sum(whole)}


def prepared(port: str, layout: str):
    """Let the driver configure the device, as all readers need it; then the device waits for NMT start."""
    from tactile_node.bus.bus_settings import BusSettings
    from tactile_node.skin.pads import make_pad
    from tactile_node.sources.supervisor import Supervisor
    pad = make_pad('pad', NODE, layout)
    bus = Supervisor(BusSettings('slcan', port), (pad,), lambda name, frame: None)
    bus.open()
    bus.configure()
    bus.close()
    return pad


def bare(port: str, layout: str, rate: float, seconds: float) -> dict:
    import can
    prepared(port, layout)
    bus = can.Bus(port, interface='slcan', bitrate=1_000_000, sleep_after_open=0.1)
    counted = [0]

    def count(message: can.Message) -> None:
        counted[0] += 1
    notifier = can.Notifier(bus, [count])
    bus.send(can.Message(arbitration_id=0, data=[1, NODE], is_extended_id=False))
    task = bus.send_periodic(can.Message(arbitration_id=0x80, is_extended_id=False), 1 / rate)
    cpu = measured(seconds)
    task.stop()
    notifier.stop()
    bus.shutdown()
    return {'cpu': cpu, 'frames': counted[0]}


def pdo_maps(port: str, layout: str, rate: float, seconds: float) -> dict:
    import canopen
    pad = prepared(port, layout)
    network = canopen.Network()
    network.connect(interface='slcan', channel=port, bitrate=1_000_000, sleep_after_open=0.1)
    node = network.add_node(canopen.RemoteNode(NODE, pad.nodes[0].dictionary))
    counted = [0]

    def count(pdo: canopen.pdo.PdoMap) -> None:
        counted[0] += len(pdo.data)
    for tpdo in pad.layout.tpdos:
        node.tpdo[tpdo.number].read()
        node.tpdo[tpdo.number].add_callback(count)
    node.nmt.send_command(1)
    network.sync.start(1 / rate)
    cpu = measured(seconds)
    network.sync.stop()
    network.disconnect()
    return {'cpu': cpu, 'bytes': counted[0]}


READERS = {'driver': driver, 'replay': replay, 'bare': bare, 'pdo maps': pdo_maps}

if __name__ == '__main__':
    if '--reader' not in sys.argv:
        from skin_process import ROOT, SkinProcess

        from tactile_node.skin.layout_file import load_layout
    sys.exit(main())
