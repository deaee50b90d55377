"""A subscriber to our messages in a separate process. The consumer prints each message on arrival as one line of JSON.

    python test/misled_consumer.py grasp=grasp left=left/shape taxels=left/taxels status=skin_driver/status

Like a planner on another machine, the consumer uses only the message types and `InputAge` from the package.
"""

import json
import math
import sys
import time
from functools import partial

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from tactile_node.ros.message_age import InputAge
from tactile_skin.msg import ContactShape, Grasp, SkinStatus, TaxelArray

BEST_EFFORT = '--best-effort'
DEPTH = 100  # length of the subscription queue [messages]
SHAPES = ('NOT_KNOWN', 'NONE', 'UNKNOWN', 'CIRCLE', 'SQUARE', 'RECTANGLE', 'RIGHT_TRIANGLE', 'ISOSCELES_TRIANGLE')
CONTACTS = ('NOT_KNOWN', 'UNSEEN', 'NO_CONTACT', 'ONE_SIDED', 'TWO_SIDED')
SIDES = ('SIDE_NOT_KNOWN', 'SIDE_UNSEEN', 'SIDE_EMPTY', 'SIDE_TOUCHED')
REASONS = ('REASON_NOT_KNOWN', 'NOT_UNKNOWN', 'NOT_SEEN', 'UNFAMILIAR', 'TOO_SMALL',
           'CUT_BY_EDGE', 'HOLLOW', 'SEVERAL_PARTS', 'COVERS_PAD', 'UNSTABLE')
STATUS_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
GAPS = ('GAP_NOT_KNOWN', 'GAP_PARAMETER', 'GAP_JOINT_STATES', 'GAP_TF')


def main() -> None:
    topics = dict(argument.split('=') for argument in sys.argv[1:] if argument != BEST_EFFORT)
    rclpy.init(args=[])
    node = Node('consumer')
    qos = QoSProfile(depth=DEPTH)
    if BEST_EFFORT in sys.argv:
        qos.reliability = ReliabilityPolicy.BEST_EFFORT
    for name, topic in topics.items():
        last = topic.rpartition('/')[2]
        kind, facts = KINDS[last]
        node.create_subscription(kind, topic, partial(report, name, facts, InputAge()),
                                 STATUS_QOS if last == 'status' else qos)
    print(json.dumps({'topic': 'ready', 'time': time.monotonic()}), flush=True)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


def report(topic, facts, ages, message) -> None:
    times = {'time': time.monotonic()}
    if hasattr(message, 'age'):
        arrived = ages.arrived(message)
        times = {'time': arrived.steady, 'age': arrived.age_on_arrival}
    numbers = {name: value if not isinstance(value, float) or math.isfinite(value) else None
               for name, value in {**times, **facts(message)}.items()}
    print(json.dumps({'topic': topic, **numbers}), flush=True)


def taxel_facts(message: TaxelArray) -> dict:
    return {**time_facts(message), 'sequence': message.sequence, 'left_out': getattr(message, 'left_out', 0)}


def diagnostic_facts(message: DiagnosticArray) -> dict:
    """Return the diagnostic values of each node, and then the values that are counts."""
    return {'nodes': {status.name: {value.key: value.value for value in status.values} for status in message.status},
            'counts': {status.name: {value.key: int(value.value) for value in status.values if value.value.isdigit()}
                       for status in message.status}}


def time_facts(message) -> dict:
    stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
    return {'latency': time.time() - stamp, 'stamp': stamp}


def shape_facts(message: ContactShape) -> dict:
    return {**time_facts(message), 'left_out': getattr(message, 'left_out', 0),
            'shape': name_of(ContactShape, SHAPES, message.shape), 'sequence': message.sequence,
            'reason': name_of(ContactShape, REASONS, getattr(message, 'unknown_reason', -1)),
            'confidence': float(message.confidence), 'taxels': message.taxels, 'force': float(message.force),
            'force_is_bound': getattr(message, 'force_is_bound', False),
            'size_is_bound': getattr(message, 'size_is_bound', False), 'fit_valid': message.fit_valid,
            'contacts': getattr(message, 'contacts', 0)}


def grasp_facts(message: Grasp) -> dict:
    return {**time_facts(message), 'contact': name_of(Grasp, CONTACTS, message.contact),
            'sides': [name_of(Grasp, SIDES, state) for state in getattr(message, 'side_states', ())],
            'shape': name_of(ContactShape, SHAPES, message.shape),
            'fresh': message.fresh, 'stable': message.stable, 'gap': float(message.gap), 'width': float(message.width),
            'offset': float(message.offset), 'sequences': [int(each) for each in message.sequences],
            'moving': [motion.moving for motion in getattr(message, 'motions', ())],
            'last_events': [motion.last_event for motion in getattr(message, 'motions', ())],
            'event_ages': [motion.last_event_age.sec for motion in getattr(message, 'motions', ())],
            'gap_source': name_of(Grasp, GAPS, getattr(message, 'gap_source', -1))}


def status_facts(message: SkinStatus) -> dict:
    return {'level': message.level, 'active': message.active, 'fault': message.fault,
            'sync_overruns': message.sync_overruns, 'stalls': message.stalls, 'overload': message.overload}


def name_of(kind: type, names: tuple[str, ...], number: int) -> str:
    """Return the name of the constant with this number, or the number if no constant has it."""
    return next((name for name in names if getattr(kind, name, None) == number), str(number))


KINDS = {'grasp': (Grasp, grasp_facts), 'shape': (ContactShape, shape_facts), 'taxels': (TaxelArray, taxel_facts),
         'status': (SkinStatus, status_facts),
         'diagnostics': (DiagnosticArray, diagnostic_facts)}  # the key is the last part of the topic


if __name__ == '__main__':
    main()
