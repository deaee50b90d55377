"""State of the gripper node as text: its entry in /diagnostics, and the reason why a goal has no usable grasp."""

import math

from diagnostic_msgs.msg import DiagnosticStatus

from tactile_node.gripper.rules.closing import FAILURES, Outcome
from tactile_node.ros.message_health import MessageCounts, several_text, status_of
from tactile_skin.msg import Grasp

NO_DATA = 1.0  #: age above which a pad is silent rather than late [s]


def gripper_status(node: str, action: str, *, duplicate: str, is_served: bool, work: str, last: Outcome | None,
                   grasp_age: float) -> DiagnosticStatus:
    """Return the entry of a gripper node in /diagnostics.

    Parameters
    ----------
    node
        Full name of the node.
    action
        Full name of the gripper's own action.
    duplicate
        Message about a second gripper node, or '' if there is only one.
    is_served
        True if the ROS graph shows a server of the gripper's own action.
    work
        Current activity: 'none', 'goal' or 'hold'.
    last
        Outcome of the latest goal or hold.
    grasp_age
        Time since both pads were last seen [s].
    """
    is_failed = last in FAILURES
    text = duplicate or (unserved_text(action) if not is_served else
                         f'the last goal ended as {last.name}' if last and is_failed else 'ready')
    level = (DiagnosticStatus.ERROR if duplicate else DiagnosticStatus.WARN
             if is_failed or not is_served else DiagnosticStatus.OK)
    return status_of(f'{node}: gripper', level, text, {
        'duplicate': bool(duplicate), 'served': is_served, 'work': work, 'last_outcome': last.name if last else 'none',
        'grasp_age_s': f'{grasp_age:.3f}' if math.isfinite(grasp_age) else 'not known'})


def unserved_text(action: str) -> str:
    """Return the text for a gripper whose own action has no server."""
    return f'no server offers {action}: start the driver of the gripper, or correct the parameter gripper_action'


def unseen_text(topic: str, counts: MessageCounts, publishers: list[str], grasp: Grasp | None, age: float,
                max_age: float) -> str:
    """Return the reason why a goal cannot close the gripper, as text.

    Parameters
    ----------
    topic
        Name of the grasp topic.
    counts
        Message counts of the grasp topic.
    publishers
        Names of the nodes that publish the grasps.
    grasp
        Latest grasp, or None if every grasp was dropped.
    age
        Age of the taxel data in the latest grasp [s].
    max_age
        Maximum age of a usable grasp [s].
    """
    if not counts.received:
        return f'no grasp has been received on {topic}: is bringup running?'
    if len(publishers) > 1:
        return several_text(topic, publishers)
    if grasp is None:
        return f'every grasp on {topic} was dropped: see /diagnostics'
    if not age < math.inf:
        return 'the age of the grasp is not known'
    if age > max(max_age, NO_DATA):
        return f'the grasp is {age:.1f} s old, because a pad sends no data: see /diagnostics of the driver'
    if age > max_age:
        return (f'the grasp is {age:.3f} s old, but max_age is {max_age:g} s: reduce the load of the machine, give the '
                'driver a longer sync_period, or raise max_age')
    states = {Grasp.SIDE_UNSEEN: 'is unseen', Grasp.SIDE_NOT_KNOWN: 'has no result yet'}
    texts = [f'the {side} pad {states[state]}' for side, state in zip(('left', 'right'), grasp.side_states)
             if state in states]
    return ' and '.join(texts) or ('for 0.5 s' if grasp.fresh else 'the grasp is not fresh, because the pads were '
                                   'acquired too far apart')
