"""QoS profiles of this package's topics. They are reliable, so that RViz and any other subscriber can read them."""

from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

REPLAY_DEPTH = 5000  #: number of messages that a replay keeps, also for late subscribers


STATUS_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TF_QOS = QoSProfile(depth=100)  # depth as in tf2_ros
TF_STATIC_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def frames_qos(depth: int, lossless: bool = False, best_effort: bool = False) -> QoSProfile:
    """Return the profile of a topic with one message per frame.

    Parameters
    ----------
    depth
        Number of messages in the queue.
    lossless
        True for a replay: publishers keep REPLAY_DEPTH messages for late subscribers. KEEP_ALL would keep more, but a
        publish would then fail while a reader is slow.
    best_effort
        True for a subscription on a link that loses packets: lost messages are not sent again, so later messages need
        not wait for them.
    """
    if lossless:
        return QoSProfile(reliability=ReliabilityPolicy.RELIABLE, depth=REPLAY_DEPTH,
                          durability=DurabilityPolicy.TRANSIENT_LOCAL)
    return QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
                      depth=depth)


def is_wanted(publisher: Publisher, lossless: bool) -> bool:
    """Return True if somebody receives the messages of ``publisher``; a lossless one also serves late subscribers."""
    return lossless or publisher.get_subscription_count() > 0


def is_lossless(profile: QoSProfile) -> bool:
    """Return True if ``profile`` is the profile of a lossless replay."""
    return bool(profile.depth >= REPLAY_DEPTH and profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)
