"""Measure start time, memory, CPU load and latency of a gripper's nodes, in one process and in several.

The gripper has two pads of 16x16 taxels, each with --rate frames per second. A rate of 109 uses 95 % of the capacity of
the bus. The simulated skin runs in a separate process behind a pseudo-terminal, like a serial CAN adapter (slcan). The
simulated skin sends each CAN frame at the time at which a real bus would have carried it. The script itself is the
consumer. For each form, the script prints the median of --repeat runs and the quietest run:

    python bench/bench_launch.py [--repeat 5] [--seconds 20] [--rate 50] [--against OTHER/.venv] [FORM ...]

The nodes compute only topics that have a subscriber. With --grasp, the consumer subscribes only to `grasp`, as a
planner does, and counts the SYNC messages for which both pads arrive in one grasp. The option --against alternates runs
of this installation with runs of another one, so that both are measured on the same machine in the same minutes.

The results are too high on a busy machine. Each run therefore waits up to --patience seconds for an idle machine. The
script also prints the CPU load of other processes during each run. The quietest run is the run with the lowest load
from other processes.
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

PADS, NODE_IDS = ('left', 'right'), '32,64'
BRINGUP = ('bringup', '--pads', ','.join(PADS))
OF_BUS = ('--interface', 'slcan', '--node-id', NODE_IDS, '--channel')
#: Arguments of `tactile bringup` for each process of a form. The last process runs the driver.
FORMS = {
    'one': [()],
    'driver_apart': [('--side', 'perception'), ('--side', 'bus')]}
ROWS = {'first_shapes': 'time from the start to a shape of both pads [s]',
        'start_cpu': 'CPU time of all processes until then [s]', 'pss': 'PSS of all processes [MB]',
        'largest': 'PSS of the largest process [MB]', 'cpu': 'CPU load of all processes [% of one core]',
        'taxels_p50': 'time from SYNC to <pad>/taxels at the consumer, median [ms]', 'taxels_p99': '..., p99',
        'carried_taxels_p50': 'time from the end of the last TPDO on the wire to <pad>/taxels, median [ms]',
        'carried_taxels_p99': '..., p99', 'carried_shape_p50': '... to <pad>/shape, median [ms]',
        'carried_shape_p99': '..., p99',
        'shape_p50': 'time from SYNC to <pad>/shape at the consumer, median [ms]', 'shape_p99': '..., p99',
        'rate': 'shapes of each pad [1/s]', 'per_frame': 'CPU time of all processes for a frame of a pad [ms]',
        'both': 'SYNC messages for which both pads arrived in one grasp [%]',
        'both_p50': 'time from SYNC to the first such grasp, median [ms]', 'both_p99': '..., p99',
        'others': 'CPU load of all other processes, without skin and consumer [% of one core]'}
START_TIMEOUT = 60.0  #: Time allowed for the nodes to start [s].
SETTLE = 3.0          #: Pause between the first shapes and the measurement [s].
IDLE = 0.15           #: Load below which the machine counts as idle [cores].
TOPICS = ('taxels', 'shape', 'carried_taxels', 'carried_shape', 'both')
ANSWER = 55e-6 + 300e-6  #: Duration of a SYNC message plus the delay of the simulated skin [s].
SWEEP = 32 * 135e-6      #: Time that the TPDOs of one pad occupy the bus [s].
TICKS = os.sysconf('SC_CLK_TCK')


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('forms', nargs='*', default=['one', 'driver_apart'], metavar='FORM')
    parser.add_argument('--repeat', type=int, default=3)
    parser.add_argument('--seconds', type=float, default=20.0, help='duration of a measurement [s]')
    parser.add_argument('--rate', type=float, default=50.0, help='SYNC messages per second (default: %(default)s)')
    parser.add_argument('--patience', type=float, default=60.0, help='longest wait for an idle machine [s]')
    parser.add_argument('--against', type=Path, help='virtual environment of another installation')
    parser.add_argument('--grasp', action='store_true', help='subscribe only to grasp')
    parser.add_argument('--single', action='store_true', help='run one form once, and print JSON')
    args = parser.parse_args()
    if args.single:
        print(json.dumps(measured(args.forms[0], args.seconds, args.rate, args.grasp)))
        return 0
    environments = {'here': Path(sys.prefix)} | ({'there': args.against} if args.against else {})
    runs: dict[tuple[str, str], list[dict[str, float]]] = {}
    for _ in range(args.repeat):
        for form in args.forms:
            for label, prefix in environments.items():
                wait_until_idle(args.patience)
                runs.setdefault((form, label), []).append(run_once(prefix, form, args))
                print('.', end='', file=sys.stderr, flush=True)
    print(file=sys.stderr)
    for (form, label), found in runs.items():
        print(f'\n{f"{form} ({label}, {len(found)} runs)":26} median  quietest run')
        quietest = min(found, key=lambda each: each['others'])
        for row, text in ((row, text) for row, text in ROWS.items() if row in quietest):
            print(f'  {row:24} {statistics.median(each[row] for each in found):6.2f} {quietest[row]:8.2f}   {text}')
    return 0


def run_once(prefix: Path, form: str, args: argparse.Namespace) -> dict[str, float]:
    """Run one measurement in a separate process, with Python and the messages of the installation at ``prefix``."""
    environment = {name: value for name, value in os.environ.items()
                   if name not in ('LD_LIBRARY_PATH', '_ROS_WHEELS_BOOTSTRAP_COMPLETE')}
    environment |= {'AMENT_PREFIX_PATH': str(prefix), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    words = [prefix / 'bin/python', Path(__file__).resolve(), form, '--single', '--seconds', str(args.seconds),
             '--rate', str(args.rate), *(['--grasp'] if args.grasp else [])]
    output = subprocess.run(words, env=environment, cwd='/', check=True, stdout=subprocess.PIPE, text=True).stdout
    return json.loads(output.splitlines()[-1])


def measured(form: str, seconds: float, rate: float, of_grasp: bool) -> dict[str, float]:
    """Start the skin and the nodes, measure for ``seconds``, and stop the processes."""
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        channel = f'{folder}/skin'
        consumer = stack.enter_context(GraspConsumer() if of_grasp else Consumer())
        skin = started(['simulate', '--pty', '--link', channel, '--node-id', NODE_IDS], stdout=subprocess.PIPE)
        stack.callback(ended, [skin])
        while b'Simulated skin' not in (line := skin.stdout.readline()):
            if not line:
                raise SystemExit('the simulated skin has not started')
        begun = time.monotonic()
        period = ['--ros-args', '-p', f'skin_driver:sync_period:={1 / rate}']
        words = [[*BRINGUP, *each] for each in FORMS[form]]
        words[-1] += [*OF_BUS, channel, *period]
        processes = [started(each) for each in words]
        stack.callback(ended, processes)
        while len(consumer.pads) < len(PADS):
            consumer.spin(0.01)
            if time.monotonic() > begun + START_TIMEOUT or any(process.poll() is not None for process in processes):
                raise SystemExit(f'{form}: expected shapes of both pads within {START_TIMEOUT} s, got none')
        first, start_cpu = time.monotonic() - begun, cpu_seconds(processes)
        consumer.spin(SETTLE)
        consumer.clear()
        cpu, busy, own, before = cpu_seconds(processes), busy_seconds(), cpu_seconds([skin]), time.monotonic()
        own += time.process_time()
        consumer.spin(seconds)
        elapsed = time.monotonic() - before
        cpu = cpu_seconds(processes) - cpu
        others = busy_seconds() - busy - cpu - (cpu_seconds([skin]) + time.process_time() - own)
        memory = [pss(process) for process in processes]
        return {'first_shapes': first, 'start_cpu': start_cpu, 'pss': sum(memory), 'largest': max(memory),
                'cpu': 100 * cpu / elapsed, 'per_frame': 1e3 * cpu / (elapsed * rate * len(PADS)),
                **{f'{topic}_p{share}': percentile(late, share) for topic, late in consumer.late.items() if late
                   for share in (50, 99)},
                **consumer.counted(elapsed, rate), 'others': 100 * others / elapsed}


class Consumer:
    """Subscribes to the taxels and shapes of all pads, and records their delays since acquisition in ``late`` [s]."""

    def __enter__(self) -> 'Consumer':
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        rclpy.init()
        self.node = rclpy.create_node('consumer')
        self.late: dict[str, list[float]] = {topic: [] for topic in TOPICS}
        self.pads: set[str] = set()  # pads whose shape has arrived
        self.subscribe()
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        return self

    def subscribe(self) -> None:
        from tactile_skin.msg import ContactShape, TaxelArray
        for pad in PADS:
            self.node.create_subscription(TaxelArray, f'{pad}/taxels',
                                          lambda message, pad=pad: self._note('taxels', pad, message), 50)
            self.node.create_subscription(ContactShape, f'{pad}/shape',
                                          lambda message, pad=pad: self._on_shape(pad, message), 50)

    def counted(self, elapsed: float, rate: float) -> dict[str, float]:
        """Return the counts over ``elapsed`` seconds, measured with ``rate`` SYNC messages per second."""
        return {'rate': len(self.late['shape']) / len(PADS) / elapsed}

    def __exit__(self, *exception) -> None:
        import rclpy
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown()

    def spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=left)

    def clear(self) -> None:
        for late in self.late.values():
            late.clear()

    def _on_shape(self, pad: str, message) -> None:
        self.pads.add(pad)
        self._note('shape', pad, message)

    def _note(self, topic: str, pad: str, message) -> None:
        late = lateness(message)
        self.late[topic].append(late)
        self.late[f'carried_{topic}'].append(late - ANSWER - SWEEP * (1 + PADS.index(pad)))


class GraspConsumer(Consumer):
    """Subscribes only to `grasp`, as a planner does."""

    def subscribe(self) -> None:
        from tactile_skin.msg import Grasp
        self._last = 0  # sequence number of the newest SYNC for which both pads have arrived
        self.node.create_subscription(Grasp, 'grasp', self._on_grasp, 50)

    def counted(self, elapsed: float, rate: float) -> dict[str, float]:
        return {'both': 100 * len(self.late['both']) / (elapsed * rate)}

    def _on_grasp(self, message) -> None:
        self.pads |= {pad for pad, state in zip(PADS, message.side_states) if state}
        left, right = message.sequences
        if left == right > self._last:
            self._last = left
            self.late['both'].append(lateness(message))


def lateness(message) -> float:
    """Return the time since the acquisition stamp [s]."""
    return time.time() - message.header.stamp.sec - message.header.stamp.nanosec * 1e-9


def started(words: list[str], **options) -> subprocess.Popen:
    return subprocess.Popen([f'{sys.prefix}/bin/tactile', *words], start_new_session=True,
                            **{'stderr': subprocess.DEVNULL, 'stdout': subprocess.DEVNULL, **options})


def ended(processes: list[subprocess.Popen]) -> None:
    for process in processes:
        process.send_signal(signal.SIGINT)
    for process in processes:
        process.wait(20)


def cpu_seconds(processes: list[subprocess.Popen]) -> float:
    """Return the user and system CPU time of the processes [s] from /proc/PID/stat (proc(5))."""
    fields = [Path(f'/proc/{process.pid}/stat').read_text().rsplit(')', 1)[1].split() for process in processes]
    return sum(int(each[11]) + int(each[12]) for each in fields) / TICKS


def busy_seconds() -> float:
    """Return the busy time of all processors [s] from /proc/stat, without idle and iowait (proc(5))."""
    fields = [int(word) for word in Path('/proc/stat').read_text().split('\n', 1)[0].split()[1:9]]
    return (sum(fields) - fields[3] - fields[4]) / TICKS


def wait_until_idle(patience: float) -> None:
    """Wait until the load stays below IDLE for one second, but at most ``patience`` seconds."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        before = busy_seconds()
        time.sleep(1.0)
        if busy_seconds() - before < IDLE:
            return


def pss(process: subprocess.Popen) -> float:
    """Return the proportional set size (PSS) of a process [MB]."""
    lines = Path(f'/proc/{process.pid}/smaps_rollup').read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith('Pss:')) / 1024


def percentile(values: list[float], share: int) -> float:
    """Return a percentile of ``values`` [s], converted to milliseconds."""
    return 1e3 * sorted(values)[min(len(values) - 1, len(values) * share // 100)]


if __name__ == '__main__':
    sys.exit(main())
