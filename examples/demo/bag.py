"""Write topics into an MCAP bag that `ros2 bag` and Foxglove can read, even if rosbag2 is not installed.

The demo starts this module in a separate process, like `ros2 bag record`. The recorder prints a line once it has
subscribed to all topics, records until the end of its standard input, and then prints the number of recorded messages.

    python -m examples.demo.bag FOLDER PAD ...
"""

import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosbags import typesys
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin, Writer

from examples.demo.topics import frame_topics
from tactile_node.logs.bag_decoder import message_types
from tactile_node.nodes.spinner import spinning
from tactile_node.ros.qos import frames_qos

MESSAGES = ('TaxelArray', 'Contact', 'FeatureRange', 'ContactFeatures', 'ContactMotion', 'ContactEvent', 'ContactShape',
            'ContactShapes', 'Grasp')
DEPTH = 1000  #: queue depth, which lets a slow machine record messages late instead of losing them


class BagRecorder:
    """Records all messages that ``node`` receives until `close` is called.

    Parameters
    ----------
    node
        Node that subscribes to the topics.
    folder
        Folder of the bag.
    topics
        Maps each topic to its type, in the form 'package/msg/Name'.
    qos
        QoS of the subscriptions.
    """

    def __init__(self, node: Node, folder: Path, topics: Mapping[str, str], qos: QoSProfile):
        types = message_types(typesys, MESSAGES)
        self.messages, self._clock = 0, node.get_clock()
        self._writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        for topic, kind in topics.items():
            package, _, name = kind.split('/')
            connection = self._writer.add_connection(topic, kind, typestore=types, offered_qos_profiles=[_RELIABLE])
            message = getattr(import_module(f'{package}.msg'), name)
            node.create_subscription(message, topic, self._writing_to(connection), qos, raw=True)

    def close(self) -> None:
        self._writer.close()

    def _writing_to(self, connection):
        def write(serialised: bytes) -> None:
            self._writer.write(connection, self._clock.now().nanoseconds, serialised)
            self.messages += 1
        return write


_RELIABLE = Qos(history=QosHistory.KEEP_LAST, depth=50, reliability=QosReliability.RELIABLE,
                durability=QosDurability.VOLATILE, deadline=QosTime(0, 0), lifespan=QosTime(0, 0),
                liveliness=QosLiveliness.AUTOMATIC, liveliness_lease_duration=QosTime(0, 0),
                avoid_ros_namespace_conventions=False)


def main(folder: str, *pads: str) -> None:
    rclpy.init()
    node = rclpy.create_node('demo_recorder')
    events = {f'/{pad}/events': 'tactile_skin/msg/ContactEvent' for pad in pads}
    recorder = BagRecorder(node, Path(folder), frame_topics(pads) | events, frames_qos(DEPTH))
    with spinning([node]):
        print('recording', flush=True)
        sys.stdin.read()
    recorder.close()
    node.destroy_node()
    rclpy.try_shutdown()
    print(recorder.messages)


if __name__ == '__main__':
    main(*sys.argv[1:])
