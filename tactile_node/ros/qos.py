"""QoS of our topics: reliable, so that RViz and any other subscriber can read them."""

from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

REPLAY_DEPTH = 5000  # messages, also for subscribers that come late


STATUS_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TF_QOS = QoSProfile(depth=100)  # as tf2_ros
TF_STATIC_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def frames_qos(depth: int, lossless: bool = False, best_effort: bool = False) -> QoSProfile:
    """Return the profile of the topics that come frame by frame.

    ``best_effort``, for a subscription: what is lost is not sent again, and nothing after it waits.

    ``lossless``, for replays: publishers keep REPLAY_DEPTH messages for subscribers that come late. (KEEP_ALL
    would do for more, but a publish then fails while a reader is slow.)
    """
    if lossless:
        return QoSProfile(reliability=ReliabilityPolicy.RELIABLE, depth=REPLAY_DEPTH,
                          durability=DurabilityPolicy.TRANSIENT_LOCAL)
    return QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
                      depth=depth)


def is_wanted(publisher: Publisher, lossless: bool) -> bool:
    """Return whether anyone gets what ``publisher`` sends: of a lossless one also who subscribes later."""
    return lossless or publisher.get_subscription_count() > 0


def is_lossless(profile: QoSProfile) -> bool:
    """Return whether ``profile`` is that of a lossless replay."""
    return bool(profile.depth >= REPLAY_DEPTH and profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)
