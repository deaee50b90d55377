"""QoS of our topics: reliable, so that RViz and any other subscriber can read them; see REP-2003 for the rest."""

from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy


def frames_qos(depth: int) -> QoSProfile:
    """Return the profile of the three frame topics; depth 0 keeps all, so that a fast replay loses nothing."""
    if depth == 0:
        return QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_ALL)
    return QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=depth)
