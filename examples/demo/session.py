"""One run of the demo: simulated skin, driver, processors, classifiers, recorder and watcher in one process."""

import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions

from examples.demo.bag import BagRecorder
from examples.demo.observation import Verdict, verdicts_of
from examples.demo.topics import frame_topics
from examples.demo.touches import GAP, TouchedPad, scripted_touches
from examples.demo.watcher import Watcher
from tactile_node.interruption import interruption
from tactile_node.node_graph import Parameters, bus_nodes
from tactile_node.nodes.spinning import Spinner
from tactile_node.nodes.system import System
from tactile_node.ros.qos import frames_qos
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.skin.pads import make_pad
from tactile_node.viewing.terminal import draw, side_by_side

PADS, NODE_IDS, LAYOUT = ('left', 'right'), (32, 64), 'sim16x16.yaml'
CHANNEL = 'tactile_demo'
FULL_SCALE = 100e3  # Pa, of LAYOUT
SYNC_PERIOD = 0.05  # s: 20 frames a second of each pad
DRAW_PERIOD = 0.1  # s
DEPTH = 1000  # messages: on a slow machine the demo is late rather than incomplete


class DemoSession:
    """A context: everything is up inside, and down again after it."""

    def __init__(self, folder: Path, seed: int, areas: Sequence[float]):
        pads = [make_pad(name, node_id, LAYOUT) for name, node_id in zip(PADS, NODE_IDS)]
        rows, cols = pads[0].layout.rows, pads[0].layout.cols
        self._pitch = pads[0].layout.pitch
        self._touches = {name: scripted_touches(seed + i, areas, rows, cols) for i, name in enumerate(PADS)}
        sources = {name: TouchedPad(touches, rows, cols, seed + len(PADS) + i)
                   for i, (name, touches) in enumerate(self._touches.items())}
        self._simulator = SkinSimulator(pads, {name: self._timed(source) for name, source in sources.items()})
        self._folder = folder
        self._origin: float | None = None  # Unix time
        self._height, self._stack = 0, ExitStack()

    def __enter__(self) -> 'DemoSession':
        self._stop_requested = self._stack.enter_context(interruption())
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self._simulator.start('virtual', CHANNEL)
        driver: Parameters = {
            'interface': 'virtual', 'channel': CHANNEL, 'node_ids': list(NODE_IDS), 'layouts': [LAYOUT],
            'sync_period': SYNC_PERIOD, 'record': str(self._folder / 'can.log')}
        # Lossless: a frame waits for the answer to the one before; without, an overloaded machine leaves frames out
        self._system = System(bus_nodes(PADS, driver=driver, every={'queue_depth': DEPTH, 'lossless': True}))
        self.watcher = Watcher(PADS, lambda stamp: stamp - (self._origin or stamp), FULL_SCALE)
        self.bag = BagRecorder(self.watcher, self._folder / 'bag', frame_topics(PADS), frames_qos(DEPTH))
        self._spinner = Spinner((*self._system.nodes, self.watcher))
        return self

    def __exit__(self, *exception) -> None:
        self._spinner.stop()
        self.bag.close()
        self._system.destroy()
        self.watcher.destroy_node()
        self._simulator.stop()
        rclpy.try_shutdown()
        self._stack.close()

    def play(self) -> None:
        """Run the script of touches until both pads have answered its end, drawing what they see."""
        self._system.driver.autostart()
        end = max(touches[-1].end for touches in self._touches.values()) + GAP
        middles = [(touch.begin + touch.end) / 2 for touch in self._touches[PADS[0]]]
        while (now := self.watcher.reached) < end:
            self._spinner.check()
            if self._stop_requested.is_set():
                raise KeyboardInterrupt
            views = self.watcher.views()
            if len(views) == len(PADS):
                if sys.stdout.isatty():
                    footer = f'{now:4.1f} of {end:.1f} s, {len(self.watcher.seen[PADS[0]])} frames a pad'
                    self._height = draw(sys.stdout, [*side_by_side(views, True), footer], self._height)
                elif middles and now > middles[0]:
                    middles.pop(0)
                    print(*side_by_side(views, False), '', sep='\n', flush=True)
            time.sleep(DRAW_PERIOD)
        self._system.driver.trigger_deactivate()

    def verdicts(self) -> list[Verdict]:
        """What was made of each touch."""
        return [verdict for pad, touches in self._touches.items()
                for verdict in verdicts_of(pad, touches, self.watcher.seen[pad])]

    def latency(self) -> str:
        """Median and 99th percentile of the time from SYNC to the shape's arrival."""
        if not self.watcher.latency:
            return 'none seen'
        median, high = np.percentile(self.watcher.latency, (50, 99)) * 1e3
        return f'median {median:.1f} ms, 99 % within {high:.1f} ms'

    @property
    def pitch(self) -> float:
        """Of both pads [m]."""
        return self._pitch

    @property
    def touches(self) -> int:
        return sum(map(len, self._touches.values()))

    def _timed(self, source):
        """The first sample of either pad shows when the script's clock began [Unix time]."""
        def sample(seconds: float):
            if self._origin is None:
                self._origin = time.time() - seconds
            return source(seconds)
        return sample
