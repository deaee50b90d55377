"""How old a shape is at its receiver when the pad is large: contacts of up to the whole pad, 50 frames a second.

Run by `make bench`, or: python bench/bench_overload.py [--side 64] [--seconds 20]. This process is the skin and the
consumer; the processing node and the classifier are processes of their own. A stage that cannot keep up works on the
newest frame and counts the others as overtaken.
"""

import argparse
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor

from tactile_node.ros.contact_messages import taxel_array_message
from tactile_node.ros.qos import frames_qos
from tactile_node.taxel_frame import TaxelFrame
from tactile_skin.msg import ContactShape, TaxelArray

PERIOD, PITCH, PAD = 0.02, 0.002, 'overload'
SHARES = (0.05, 0.25, 0.5, 0.75, 1.0)  #: of the pad that the contact covers
SETTLE, START_TIMEOUT = 3.0, 60.0      #: [s]


class Skin:
    """Publishes the frames of a pad and notes the age of the shapes that come back."""

    def __init__(self, side: int):
        self.node = rclpy.create_node('skin')
        self.ages: list[float] = []
        self._side, self._sequence = side, 0
        self._frames = self.node.create_publisher(TaxelArray, f'/{PAD}/taxels', frames_qos(10))
        self.node.create_subscription(ContactShape, f'/{PAD}/shape', self._on_shape, frames_qos(50))
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self._values = np.zeros((side, side), np.float32)
        self._rng = np.random.default_rng(0)

    def press(self, share: float) -> int:
        """From now on a disc over ``share`` of the pad; return its taxels."""
        rows, cols = np.indices((self._side, self._side)) - (self._side - 1) / 2
        away = np.hypot(rows, cols) if share < 0.75 else np.maximum(abs(rows), abs(cols)) * np.sqrt(4 / np.pi)
        pressed = away <= np.sqrt(share / np.pi) * self._side * 1.001
        self._values = np.where(pressed, np.float32(50e3), np.float32(0))
        return int(pressed.sum())

    def run(self, seconds: float) -> int:
        """Publish one frame a period; return their number."""
        end, due, before = time.monotonic() + seconds, time.monotonic(), self._sequence
        status = np.ones(self._values.shape, np.uint8)
        while time.monotonic() < end:
            noise = self._rng.normal(0, 300, self._values.shape).astype(np.float32)
            frame = TaxelFrame(time.time(), self._sequence, self._values + noise, status, 0)
            self._frames.publish(taxel_array_message(frame, PITCH, 'Pa', PAD))
            self._sequence += 1
            due += PERIOD
            while (left := due - time.monotonic()) > 0:
                self.executor.spin_once(timeout_sec=left)
        return self._sequence - before

    def _on_shape(self, message: ContactShape) -> None:
        stamp = message.header.stamp
        self.ages.append(time.time() - stamp.sec - stamp.nanosec * 1e-9)


def started(role: str) -> subprocess.Popen:
    words = [sys.executable, '-m', f'tactile_node.nodes.{role}_node', '--ros-args', '-r', f'__ns:=/{PAD}']
    return subprocess.Popen(words, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--side', type=int, default=64, help='of the pad [taxels]')
    parser.add_argument('--seconds', type=float, default=20.0, help='of each contact')
    args = parser.parse_args()
    rclpy.init()
    skin, processes = Skin(args.side), [started(role) for role in ('processor', 'classifier')]
    try:
        begun = time.monotonic()
        while not skin.ages:
            skin.run(0.5)
            if time.monotonic() > begun + START_TIMEOUT or any(process.poll() is not None for process in processes):
                raise SystemExit(f'expected a shape within {START_TIMEOUT:g} s, got none')
        print('| taxels | answered | age of a shape, p50 | p99 | largest [ms] |\n| --- | --- | --- | --- | --- |')
        for share in SHARES:
            taxels = skin.press(share)
            skin.run(SETTLE)
            skin.ages.clear()
            sent = skin.run(args.seconds)
            ages = 1e3 * np.array(skin.ages)
            p50, p99 = np.quantile(ages, (0.5, 0.99))
            print(f'| {taxels} | {len(ages) / sent:.0%} | {p50:.0f} | {p99:.0f} | {ages.max():.0f} |', flush=True)
        print(f'Required: p99 below {3 * PERIOD * 1e3:.0f} ms, three periods.')
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            process.wait(20)
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
