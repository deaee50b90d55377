"""A consumer of our messages in a separate process: prints what it receives, one JSON line each, when it comes.

    python test/misled_consumer.py grasp=grasp left=left/shape taxels=left/taxels status=skin_driver/status

It knows the message types and `InputAge` only, as a planner on another machine would.
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
from rclpy.qos import DurabilityPolicy, QoSProfile

from tactile_node.ros.message_age import InputAge
from tactile_skin.msg import ContactShape, Grasp, SkinStatus, TaxelArray

SHAPES = ('NOT_KNOWN', 'NONE', 'UNKNOWN', 'CIRCLE', 'SQUARE', 'RECTANGLE', 'RIGHT_TRIANGLE', 'ISOSCELES_TRIANGLE')
CONTACTS = ('NOT_KNOWN', 'UNSEEN', 'NO_CONTACT', 'ONE_SIDED', 'TWO_SIDED')
SIDES = ('SIDE_NOT_KNOWN', 'SIDE_UNSEEN', 'SIDE_EMPTY', 'SIDE_TOUCHED')
REASONS = ('REASON_NOT_KNOWN', 'NOT_UNKNOWN', 'NOT_SEEN', 'UNFAMILIAR', 'TOO_SMALL')
STATUS_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
GAPS = ('GAP_NOT_KNOWN', 'GAP_PARAMETER', 'GAP_JOINT_STATES', 'GAP_TF')


def main() -> None:
    topics = dict(argument.split('=') for argument in sys.argv[1:])
    rclpy.init(args=[])
    node = Node('consumer')
    qos = QoSProfile(depth=100)
    for name, topic in topics.items():
        kind, facts = KINDS.get(name, (ContactShape, shape_facts))
        node.create_subscription(kind, topic, partial(report, name, facts, InputAge()),
                                 STATUS_QOS if name == 'status' else qos)
    print(json.dumps({'topic': 'ready', 'time': time.monotonic()}), flush=True)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


def report(topic, facts, ages, message) -> None:
    now, here = time.monotonic(), {}
    if hasattr(message, 'age'):
        arrival = ages.arrived(message)
        now, here = arrival.steady, {'age_here': arrival.age_on_arrival}
    numbers = {name: value if not isinstance(value, float) or math.isfinite(value) else None
               for name, value in (facts(message) | here).items()}
    print(json.dumps({'topic': topic, 'time': now, **numbers}), flush=True)


def shape_facts(message: ContactShape) -> dict:
    return {'latency': time.time() - message.header.stamp.sec - 1e-9 * message.header.stamp.nanosec,
            'shape': name_of(ContactShape, SHAPES, message.shape), 'sequence': message.sequence,
            'left_out': message.left_out,
            'reason': name_of(ContactShape, REASONS, getattr(message, 'unknown_reason', -1)),
            'confidence': float(message.confidence), 'taxels': message.taxels, 'force': float(message.force),
            'force_is_bound': getattr(message, 'force_is_bound', False),
            'size_is_bound': getattr(message, 'size_is_bound', False), 'fit_valid': message.fit_valid,
            'contacts': getattr(message, 'contacts', 0), 'age': seconds(message)}


def grasp_facts(message: Grasp) -> dict:
    return {'contact': name_of(Grasp, CONTACTS, message.contact),
            'sides': [name_of(Grasp, SIDES, state) for state in getattr(message, 'side_states', ())],
            'shapes': [name_of(ContactShape, SHAPES, side.shape) for side in message.sides],
            'fresh': message.fresh, 'stable': message.stable, 'gap': float(message.gap), 'width': float(message.width),
            'offset': float(message.offset), 'age': seconds(message),
            'sequences': [side.sequence for side in message.sides],
            'gap_source': name_of(Grasp, GAPS, getattr(message, 'gap_source', -1))}


def taxel_facts(message: TaxelArray) -> dict:
    return {'sequence': message.sequence, 'missing': message.missing_can_frames}


def status_facts(message: SkinStatus) -> dict:
    return {'level': message.level, 'active': message.active, 'fault': message.fault,
            'sync_overruns': message.sync_overruns, 'stalls': message.stalls, 'overload': message.overload}


def health_facts(message: DiagnosticArray) -> dict:
    """What the nodes say of the messages that they receive."""
    return {'nodes': {status.name: {pair.key: pair.value for pair in status.values} for status in message.status}}


def seconds(message) -> float:
    """The message's age [s]; NaN where it has none."""
    age = getattr(message, 'age', None)
    return math.nan if age is None else age.sec + age.nanosec * 1e-9


def name_of(kind: type, names: tuple[str, ...], number: int) -> str:
    """The name of a constant; a message of an older version has fewer."""
    return next((name for name in names if getattr(kind, name, None) == number), str(number))


KINDS = {'grasp': (Grasp, grasp_facts), 'taxels': (TaxelArray, taxel_facts), 'status': (SkinStatus, status_facts),
         'health': (DiagnosticArray, health_facts)}  # of others: ContactShape


if __name__ == '__main__':
    main()
