"""What the topics of a gripper with two simulated pads carry: bytes of a message, and a second.

    python bench/pads_topics.py [--seconds 20]
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile

from tactile_skin.msg import Contact, ContactShape, Grasp, SkinStatus, TaxelArray

NAMESPACE, PAD = 'sizes', 'left'
KINDS = {f'{PAD}/taxels': TaxelArray, f'{PAD}/contact': Contact, f'{PAD}/shape': ContactShape, 'grasp': Grasp,
         'skin_driver/status': SkinStatus, '/diagnostics': DiagnosticArray}  # of all six nodes
RATE = 50  #: frames a second, of the simulated skin
START_TIMEOUT = 60.0  #: s


class Carried(NamedTuple):
    """On one topic; ``most``: bytes of the largest message; without the headers of RTPS, UDP and IP."""

    topic: str
    messages: float  #: a second
    mean: float      #: bytes of a message
    most: int

    @property
    def rate(self) -> float:
        """Bytes a second."""
        return self.messages * self.mean


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--seconds', type=float, default=20.0, help='default %(default)s')
    args = parser.parse_args()
    for carried in measured(args.seconds):
        print(json.dumps(carried))
    return 0


def measured(seconds: float) -> list[Carried]:
    words = [sys.executable, '-m', 'tactile_node.cli.main', 'bringup', '--simulate', '--pads', f'{PAD},right',
             '--node-id', '32,40', '--namespace', NAMESPACE]
    process = subprocess.Popen(words, cwd=ROOT, env=os.environ | {'PYTHONPATH': str(ROOT)}, start_new_session=True,
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    rclpy.init()
    node, executor = rclpy.create_node('sizes'), SingleThreadedExecutor()
    executor.add_node(node)
    sizes: dict[str, list[int]] = {topic: [] for topic in KINDS}
    for topic, kind in KINDS.items():
        name = topic if topic.startswith('/') else f'/{NAMESPACE}/{topic}'
        node.create_subscription(kind, name, lambda message, topic=topic: sizes[topic].append(len(message)),
                                 QoSProfile(depth=200), raw=True)
    try:
        end = time.monotonic() + START_TIMEOUT
        while not all(sizes.values()) and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        for of_topic in sizes.values():
            of_topic.clear()
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            executor.spin_once(timeout_sec=left)
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(30)
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown()
    return [Carried(topic, len(found) / seconds, sum(found) / max(len(found), 1), max(found, default=0))
            for topic, found in sizes.items()]


if __name__ == '__main__':
    sys.exit(main())
