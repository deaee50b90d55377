"""Makes text of what the gripper node knows: an entry of /diagnostics, and why a goal was not seen."""

import math

from diagnostic_msgs.msg import DiagnosticStatus

from tactile_node.grasp.closing import Outcome
from tactile_node.ros.message_health import MessageCounts, several_text, status_of
from tactile_skin.msg import Grasp

#: Outcomes after which the gripper or its wiring needs a look
FAILURES = (Outcome.NO_GRIPPER, Outcome.GRIPPER_SILENT, Outcome.NOT_STOPPED, Outcome.NOT_OPENING)


def gripper_status(node: str, action: str, *, duplicate: str, is_served: bool, work: str, last: Outcome | None,
                   grasp_age: float) -> DiagnosticStatus:
    """Return the entry of the gripper in front of whose ``action`` the ``node`` stands, both by their full names.

    ``duplicate``: the sentence, '' without one.
    ``is_served``: the graph shows a server of the gripper's own action.
    ``work``: 'none', 'goal' or 'hold'.
    ``last``: how the latest goal or hold ended.
    ``grasp_age``: since both pads were seen [s].
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
    """Return what is missing for a goal to close; ``grasp``: the latest, whose taxels are ``age`` old [s]."""
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
