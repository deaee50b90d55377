"""Run the demo, with skin, nodes and recorder in separate processes, as on a robot.

The process of this module only listens, like a planner, and therefore measures the same latency as a planner.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import rclpy
from rclpy.signals import SignalHandlerOptions

from examples.demo.observation import Performance, TouchVerdict, verdicts_of
from examples.demo.touches import GAP, LAYOUT, NODE_IDS, PADS, demo_pads, scripts_of
from examples.demo.watcher import Watcher
from tactile_node.errors import TactileError
from tactile_node.interruption import interruption
from tactile_node.nodes.spinner import Spinner
from tactile_node.viewing.terminal import draw, side_by_side

ROOT = Path(__file__).resolve().parents[2]
FULL_SCALE = 100e3  #: full scale of the taxels in LAYOUT [Pa]
SYNC_PERIOD = 0.05  #: time between two SYNC messages [s], for 20 frames per second from each pad
DRAW_PERIOD = 0.1  #: time between two updates of the view [s]
LEAD = 0.2  #: delay before the script of touches begins [s]
PATIENCE = 20.0  #: longest wait for the first shapes, and again for the last shapes [s]
END_TIMEOUT = 60.0  #: time allowed for a process to end [s]


class Part:
    """A Python module in a separate process. Ctrl-C reaches only the main process, which then ends all parts."""

    def __init__(self, stack: ExitStack, module: str, *words: str):
        self._module = module
        self._process = subprocess.Popen([sys.executable, '-m', module, *words], cwd=ROOT, text=True,
                                         start_new_session=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        stack.callback(self.end)

    def read_line(self) -> str:
        """Return the line that the process prints when ready. Raises TactileError if the process has ended."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            self._process.wait()
            self.check()
        return line.strip()

    def write_line(self, line: str) -> None:
        assert self._process.stdin is not None
        print(line, file=self._process.stdin, flush=True)

    def check(self) -> None:
        """Raise TactileError if the process has ended."""
        if self._process.poll() is not None:
            raise TactileError(self._module, expected='a process that runs until the demo ends',
                               got=f'exit code {self._process.returncode}', remedy='Read the error output above.')

    def waited(self) -> float:
        """Return the total time that all threads of the process have waited for a processor [s], or 0 if unknown.

        The second number in schedstat (proc(5)) is the time on a run queue [ns].
        """
        tasks = Path(f'/proc/{self._process.pid}/task').glob('*/schedstat')
        return sum(int(task.read_text().split()[1]) for task in tasks) / 1e9

    def end(self) -> str:
        """End the process by closing its input, and return the rest of its output."""
        if self._process.stdin is None or self._process.stdin.closed:
            return ''
        return self._process.communicate(timeout=END_TIMEOUT)[0]


class Nodes(Part):
    """The process of `tactile bringup`, which needs a signal to end."""

    def end(self) -> str:
        self._process.terminate()
        return super().end()


class DemoSession:
    """A context that starts all processes of the demo on entry and ends them on exit."""

    def __init__(self, folder: Path, seed: int, areas: Sequence[float]):
        self.pitch = demo_pads()[0].layout.pitch  #: distance between neighbouring taxels on both pads [m]
        self._touches = scripts_of(seed, areas)
        self._skin_words = [str(seed), *map(str, areas)]
        self._folder = folder.resolve()
        self._begin: float | None = None  # time at which the script begins [s, Unix epoch]
        self._height = 0
        self.recorded = 0  #: number of messages in the bag
        self.began_empty = False  #: True if both pads were reported as empty before the first touch
        self.performance = Performance((), frames=0, skin_late=0.0)

    def __enter__(self) -> 'DemoSession':
        with ExitStack() as stack:
            self._stop_requested = stack.enter_context(interruption())
            self._skin = Part(stack, 'examples.demo.skin', *self._skin_words)
            self._recorder = Part(stack, 'examples.demo.bag', str(self._folder / 'bag'), *PADS)
            port = self._skin.read_line()
            self._recorder.read_line()
            self._nodes = Nodes(
                stack, 'tactile_node.cli.main', 'bringup', '--interface', 'slcan', '--channel', port, '--pads',
                ','.join(PADS), '--node-id', ','.join(map(str, NODE_IDS)), '--layout', LAYOUT, '--record',
                str(self._folder / 'can.log'), '--end-with', str(os.getpid()), '--ros-args', '-p',
                f'skin_driver:sync_period:={SYNC_PERIOD}')
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
            stack.callback(rclpy.try_shutdown)
            self.watcher = Watcher(PADS, self._demo_time, FULL_SCALE)
            stack.callback(self.watcher.destroy_node)
            self._spinner = Spinner([self.watcher])
            stack.callback(self._spinner.stop)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()

    def play(self) -> None:
        """Run the script of touches and draw both pads, until shapes for the end of the script have arrived."""
        self._wait_until_ready()
        self._begin = time.time() + LEAD
        self._skin.write_line(repr(self._begin))
        end = max(touches[-1].end for touches in self._touches.values()) + GAP
        middles = [(touch.begin + touch.end) / 2 for touch in self._touches[PADS[0]]]
        began, waited = time.monotonic(), self._nodes.waited()
        give_up = began + LEAD + end + PATIENCE
        while (now := self.watcher.reached) < end and time.monotonic() < give_up:
            self._check()
            views = self.watcher.views()
            if sys.stdout.isatty():
                footer = f'{max(now, 0.0):4.1f} of {end:.1f} s, {len(self.watcher.seen[PADS[0]])} frames a pad'
                self._height = draw(sys.stdout, [*side_by_side(views, True), footer], self._height)
            elif middles and now > middles[0]:
                middles.pop(0)
                print(*side_by_side(views, False), '', sep='\n', flush=True)
            time.sleep(DRAW_PERIOD)
        waited = (self._nodes.waited() - waited) / (time.monotonic() - began)
        self._nodes.end()
        report = json.loads(self._skin.end())
        self.recorded = int(self._recorder.end())
        self.performance = Performance(tuple(self.watcher.latency), frames=round(len(PADS) * end / SYNC_PERIOD),
                                       skin_late=report['late_p99'], waited=waited)

    def verdicts(self) -> list[TouchVerdict]:
        """Return a verdict for each touch."""
        return [verdict for pad, touches in self._touches.items()
                for verdict in verdicts_of(pad, touches, self.watcher.seen[pad], self.pitch)]

    @property
    def touches(self) -> int:
        return sum(map(len, self._touches.values()))

    def _wait_until_ready(self) -> None:
        """Wait until both pads are reported as empty, but at most PATIENCE.

        On an overloaded machine, the pads may never be reported as empty.
        """
        give_up = time.monotonic() + PATIENCE
        while not (is_empty := self.watcher.is_empty) and time.monotonic() < give_up:
            self._check()
            time.sleep(DRAW_PERIOD)
        self.began_empty = is_empty

    def _check(self) -> None:
        self._spinner.check()
        if self._stop_requested.is_set():
            raise KeyboardInterrupt
        for part in (self._skin, self._nodes, self._recorder):
            part.check()

    def _demo_time(self, stamp: float) -> float:
        """Convert an acquisition stamp to the script's time [s], which is negative before the script begins."""
        return stamp - self._begin if self._begin is not None else -LEAD
