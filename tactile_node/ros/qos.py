"""QoS profiles of this package's topics, which are reliable so that RViz and any other subscriber can read them."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

REPLAY_DEPTH = 5000  #: number of messages that a lossless replay keeps, including for late subscribers


STATUS_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TF_QOS = QoSProfile(depth=100)  # queue depth as in tf2_ros
TF_STATIC_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def frames_qos(depth: int, lossless: bool = False, best_effort: bool = False) -> QoSProfile:
    """Return the profile of a topic that carries one message per taxel frame.

    Parameters
    ----------
    depth
        Queue depth [messages].
    lossless
        True for a lossless replay, in which publishers keep REPLAY_DEPTH messages for late subscribers. The policy
        KEEP_ALL would keep more messages, but publishing would fail while a subscriber is slow.
    best_effort
        True for a subscription over a link that loses packets. Lost messages are then not sent again, so later messages
        do not wait for them.
    """
    if lossless:
        return QoSProfile(reliability=ReliabilityPolicy.RELIABLE, depth=REPLAY_DEPTH,
                          durability=DurabilityPolicy.TRANSIENT_LOCAL)
    return QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
                      depth=depth)
