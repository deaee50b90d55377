"""Read the topics of running nodes for `tactile view`."""

import math
import threading
import time
from collections import OrderedDict
from collections.abc import Sequence
from functools import partial

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.tracker import GraspContact
from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.guarded_input import FrameKey, frame_key
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.spinner import Spinner
from tactile_node.ros.contact_messages import pad_frame_of
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.message_age import InputAge, age_seconds
from tactile_node.ros.message_checks import check_contact, check_contact_shape, check_taxel_array
from tactile_node.ros.qos import STATUS_QOS, frames_qos
from tactile_node.ros.time_messages import seconds
from tactile_node.shape.recognition import UnknownReason
from tactile_node.viewing.source import Store, ViewSource
from tactile_node.viewing.states import GraspFacts, PadState, SeenContact, moving_words
from tactile_skin.msg import Contact, ContactShape, Grasp, SkinStatus, TaxelArray

SHAPE_RATE = 20.0  #: Maximum rate at which the display of a pad is updated [1/s].
MOST_WAITING = 16  #: Maximum number of messages of a pad that wait for the shape of the same frame.
WITHOUT_SHAPE = 0.5  #: Time without any shape after which taxels are displayed alone [s].
DISCOVERY_TIMEOUT = 5.0  #: Time allowed for discovering the topics of the pads [s].
DISCOVERY_LOOK_PERIOD = 0.25  #: Time between two checks for new topics [s].
#: Number of checks with the same topics after which the search ends. One check is not enough, because two drivers are
#: not discovered at the same time.
DISCOVERY_LOOKS = 3
VIEW_QUEUE_DEPTH = 5  #: Queue depth of the subscriptions [messages].
VIEW_NODE_NAME = 'tactile_view'
TAXELS_TYPE = 'tactile_skin/msg/TaxelArray'


class TopicSource(ViewSource):
    """A `ViewSource` that reads the topics of running nodes. The source subscribes only between ``start`` and ``stop``.

    Parameters
    ----------
    pads : sequence of str
        Names of the pads, relative to the namespace; empty for all pads that publish taxels in the namespace.
    namespace : str
        Namespace of the driver; '' for the root namespace.

    Raises
    ------
    ConfigurationError
        Raised if no pad is named and no pad is found.
    """

    def __init__(self, pads: Sequence[str] = (), namespace: str = ''):
        self._root = f'/{namespace.strip("/")}/' if namespace.strip('/') else '/'
        self.title = f'topics below {self._root}'
        self._lock = threading.Lock()
        self._node: Node | None = None
        self._spinner: Spinner | None = None
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self._is_open = True
        self.store = Store(pads or self._found_pads())

    def start(self) -> None:
        """Subscribe to the topics of the pads, the driver and the grasp node."""
        with self._lock:
            node = self._node = Node(VIEW_NODE_NAME)
            for pad in self.store.pads:
                _PadTopics(node, pad, self._root + pad, self.store)
            status = f'{self._root}{NODE_NAMES[Role.DRIVER]}/status'
            node.create_subscription(SkinStatus, status, self.store.put_bus, STATUS_QOS)
            self._grasp_age = InputAge()
            GuardedSubscription(node, Grasp, f'{self._root}grasp', self._grasp, frames_qos(VIEW_QUEUE_DEPTH),
                                check=check_grasp, newest_only=True)
            self._spinner = Spinner([node], self.store.put_error)

    def stop(self) -> None:
        """End all subscriptions and clear the stored messages."""
        with self._lock:
            if self._spinner is not None:
                self._spinner.stop()
            if self._node is not None:  # the node exists without a spinner if ``start`` failed
                self._node.destroy_node()
            self._spinner = self._node = None
        self.store.clear()

    def close(self) -> None:
        """Stop the source and shut down rclpy."""
        self.stop()
        if self._is_open:
            self._is_open = False
            rclpy.try_shutdown()

    def _grasp(self, message: Grasp) -> None:
        arrival = self._grasp_age.arrived(message)
        self.store.put_grasp(GraspFacts(GraspContact(message.contact).name.lower(), message.fresh, message.stable,
                                        arrival.acquired))

    def _found_pads(self) -> list[str]:
        node = Node(f'{VIEW_NODE_NAME}_discovery')
        try:
            topics = [topic for topic in _topics(node, TAXELS_TYPE, DISCOVERY_TIMEOUT) if topic.startswith(self._root)]
        finally:
            node.destroy_node()
        if not topics:
            rclpy.try_shutdown()
            raise ConfigurationError(f'topics below {self._root}', expected='<pad>/taxels of a running driver',
                                     got='none', remedy='Start the driver, or name the pads with --pads. For a bus, '
                                     'use --interface.')
        return sorted(topic.removeprefix(self._root).rpartition('/')[0] for topic in topics)


def _topics(node: Node, kind: str, timeout: float) -> list[str]:
    """Return the names of all topics of a type, as soon as topics are found and their number stops growing."""
    looks: list[list[str]] = []
    for _ in range(round(timeout / DISCOVERY_LOOK_PERIOD)):
        looks.append([topic for topic, kinds in node.get_topic_names_and_types() if kind in kinds])
        if looks[-1] and looks[-DISCOVERY_LOOKS:] == DISCOVERY_LOOKS * [looks[-1]]:
            break
        time.sleep(DISCOVERY_LOOK_PERIOD)
    return looks[-1]


class _PadTopics:
    """Combines the messages of one pad, so that a shape is displayed on the taxels from which it was recognised.

    Messages are matched by sequence number and stamp, because the sequence restarts whenever the driver starts.
    """

    def __init__(self, node: Node, pad: str, root: str, store: Store):
        self._pad, self._store = pad, store
        self._taxels: OrderedDict[FrameKey, tuple[TaxelArray, float]] = OrderedDict()
        self._contacts: OrderedDict[FrameKey, Contact] = OrderedDict()
        self._shape_came = -math.inf  # time when the last shape arrived, on the steady clock [s]
        self._shown = -math.inf  # time of the last update of the display, on the steady clock [s]
        qos = frames_qos(VIEW_QUEUE_DEPTH)
        self._subscription = GuardedSubscription(node, TaxelArray, f'{root}/taxels', self._on_taxels, qos,
                                                 check=check_taxel_array)
        GuardedSubscription(node, Contact, f'{root}/contact', partial(_keep, self._contacts), qos, check=check_contact)
        GuardedSubscription(node, ContactShape, f'{root}/shape', self._on_shape, qos, check=check_contact_shape,
                            newest_only=True)

    def _on_taxels(self, message: TaxelArray) -> None:
        now = time.monotonic()
        _keep(self._taxels, message, (message, self._subscription.acquired))
        if now - self._shape_came > WITHOUT_SHAPE:
            self._show(frame_key(message), None, now)

    def _on_shape(self, message: ContactShape) -> None:
        now = time.monotonic()
        if frame_key(message) in self._taxels:  # a late shape whose taxels are gone must not hold back newer taxels
            self._shape_came = now
            self._show(frame_key(message), message, now)

    def _show(self, key: FrameKey, shape: ContactShape | None, now: float) -> None:
        if now - self._shown < 1 / SHAPE_RATE:
            return
        self._shown = now
        taxels, acquired = self._taxels[key]
        self._store.put(_state(self._pad, taxels, acquired, shape, self._contacts.get(key)))


def _keep(waiting: OrderedDict, message, value=None) -> None:
    waiting[frame_key(message)] = message if value is None else value
    if len(waiting) > MOST_WAITING:
        waiting.popitem(last=False)


def _state(pad: str, taxels: TaxelArray, acquired: float, shape: ContactShape | None,
           contact: Contact | None) -> PadState:
    frame = pad_frame_of(taxels)
    mask = None
    if contact is not None:
        mask = np.frombuffer(contact.labels, np.uint8).reshape(contact.rows, contact.cols) == 1
    seen = None if shape is None else _seen(shape, mask)
    return PadState(pad, seconds(taxels.header.stamp), acquired, frame.values, frame.status, float(taxels.pitch),
                    taxels.unit, seen)


def _seen(shape: ContactShape, mask: np.ndarray | None) -> SeenContact:
    reason = UnknownReason(shape.unknown_reason).name.lower() if shape.shape == ContactShape.UNKNOWN else ''
    outline = np.array([(point.x, point.y) for point in shape.outline.points]) if shape.fit_valid else None
    return SeenContact(shape.class_name, reason, dict(zip(shape.class_names, map(float, shape.probabilities))), outline,
                       tuple(zip(shape.dimension_names, map(float, shape.dimensions))) if shape.fit_valid else (),
                       bool(shape.size_is_bound), float(shape.force), mask, bool(shape.force_is_bound),
                       moving_words(shape.motion.moving, shape.motion.speed, shape.motion.rate,
                                    shape.motion.last_event, age_seconds(shape.motion.last_event_age)))
