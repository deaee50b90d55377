"""State of the gripper node as text: its entry in /diagnostics, and the reason why a goal saw no grasp."""

import math

from diagnostic_msgs.msg import DiagnosticStatus

from tactile_node.grasp.closing import Outcome
from tactile_node.ros.message_health import MessageCounts, several_text, status_of
from tactile_skin.msg import Grasp

#: outcomes after which a person should check the gripper or its wiring
FAILURES = (Outcome.NO_GRIPPER, Outcome.GRIPPER_SILENT, Outcome.NOT_STOPPED, Outcome.NOT_OPENING)


def gripper_status(node: str, action: str, *, duplicate: str, is_served: bool, work: str, last: Outcome | None,
                   grasp_age: float) -> DiagnosticStatus:
    """Return the diagnostic entry of a gripper node.

    Parameters
    ----------
    node
        Full name of the node.
    action
        Full name of the gripper's own action.
    duplicate
        Sentence about a second gripper node; '' if there is none.
    is_served
        True if the ROS graph shows a server of the gripper's own action.
    work
        Present work: 'none', 'goal' or 'hold'.
    last
        Outcome of the latest goal or hold.
    grasp_age
        Time since both pads were seen [s].
    """
    is_failed = last in FAILURES
    text = duplicate or (f'nothing serves {action}' if not is_served else
                         f'the last goal ended as {last.name}' if last and is_failed else 'ready')
    level = (DiagnosticStatus.ERROR if duplicate else DiagnosticStatus.WARN
             if is_failed or not is_served else DiagnosticStatus.OK)
    return status_of(f'{node}: gripper', level, text, {
        'duplicate': bool(duplicate), 'served': is_served, 'work': work, 'last_outcome': last.name if last else 'none',
        'grasp_age_s': f'{grasp_age:.3f}' if math.isfinite(grasp_age) else 'not known'})


def unseen_text(topic: str, counts: MessageCounts, publishers: list[str], grasp: Grasp | None, age: float,
                max_age: float) -> str:
    """Return the reason why a goal cannot close the gripper.

    Parameters
    ----------
    topic
        Topic of the grasps.
    counts
        Counts of the messages on this topic.
    publishers
        Names of the nodes that publish it.
    grasp
        Latest grasp; None if every grasp was dropped.
    age
        Age of the taxels of this grasp [s].
    max_age
        Largest age of a usable grasp [s].
    """
    if not counts.received:
        return f'no grasp has been received on {topic}: is bringup running?'
    if len(publishers) > 1:
        return several_text(topic, publishers)
    if grasp is None:
        return f'every grasp on {topic} was dropped: see /diagnostics'
    if not age <= max_age:
        return f'the grasp is {age:.3f} s old, max_age is {max_age:g} s' if age < math.inf else 'its age is not known'
    states = {Grasp.SIDE_UNSEEN: 'is unseen', Grasp.SIDE_NOT_KNOWN: 'has no result yet'}
    texts = [f'the {side} pad {states[state]}' for side, state in zip(('left', 'right'), grasp.side_states)
             if state in states]
    return ' and '.join(texts) or ('for 0.5 s' if grasp.fresh else 'the grasp is not fresh: the pads are too far apart '
                                   'in time')
