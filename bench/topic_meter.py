"""Measures topics where it runs: prints one JSON line for each with its messages, their octets and their latencies.

    python bench/topic_meter.py 5.0 left/taxels=tactile_skin/msg/TaxelArray
"""

import importlib
import json
import sys
import time
from functools import partial
from pathlib import Path

import rclpy
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message

SETTLE = 4.0  # s, until discovery is over also on a busy machine: it is traffic, too
LINK = 'veth'  # of two_hosts.py


def main() -> None:
    """Prints "ready" when the time that is measured begins."""
    seconds, *topics = sys.argv[1:]
    rclpy.init(args=[])
    node = rclpy.create_node('topic_meter')
    received: dict[str, list[tuple[float, bytes]]] = {}
    kinds = {}
    for topic, kind in (word.split('=') for word in topics):
        package, _, name = kind.split('/')
        kinds[topic] = getattr(importlib.import_module(f'{package}.msg'), name)
        received[topic] = []
        node.create_subscription(kinds[topic], topic, partial(note, received[topic]), QoSProfile(depth=100), raw=True)
    spin(node, SETTLE)
    for messages in received.values():
        messages.clear()
    print('ready', *link_counts(), flush=True)
    spin(node, float(seconds))
    print('done', *link_counts(), flush=True)
    for topic, messages in received.items():
        print(json.dumps({'topic': topic, 'count': len(messages), 'octets': sum(len(data) for _, data in messages),
                          'latencies': [arrival - seconds_of(deserialize_message(data, kinds[topic]))
                                        for arrival, data in messages]}), flush=True)


def note(messages: list, data: bytes) -> None:
    messages.append((time.time(), data))


def link_counts() -> tuple[float, int, int]:
    """The time, and the octets that this host has received and sent over the link."""
    lines = Path('/proc/self/net/dev').read_text(encoding='ascii').splitlines()  # of this process's namespace
    link, = (line.split(':')[1].split() for line in lines if line.strip().startswith(LINK))
    return time.monotonic(), int(link[0]), int(link[8])


def seconds_of(message) -> float:
    """The stamp of a message, or of the first of its parts [s]; of those without any, what gives NaN."""
    message = message.markers[0] if getattr(message, 'markers', None) else message
    if not hasattr(message, 'header'):
        return float('nan')
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


def spin(node, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.02)


if __name__ == '__main__':
    main()
