"""The loop around examples/planner_client.py: close lightly, ask, move, until the contacts oppose or it gives up.

It reads decisions only; what moves the gripper is yours:

    loop = GraspLoop()
    loop.closed(now)                                  # at a light force, 2 N
    order = loop.next(planner.decide(now), now)       # as often as you like
    'wait': ask again; 'move': open, move by order.correction, close, loop.closed(now); 'done': squeeze and lift;
    'give_up': do not squeeze, order.reason says why
"""

from enum import IntEnum
from typing import NamedTuple

SETTLE = 0.4      # s after closing; more than MAX_AGE of the planner: what it decides on was acquired after closing
PATIENCE = 5.0    # s without a decision, since the gripper has closed
MAX_MOVES = 12
MOVES = ('shift', 'rotate', 'tilt', 'regrasp')


class Reason(IntEnum):
    """Why it gave up."""

    NOT_KNOWN = 0
    NOT_GIVEN_UP = 1
    NOT_SEEN = 2     # nothing was known of what the gripper holds
    NO_DECISION = 3  # a contact is missing, never stable, or cut at one pad alone
    EMPTY = 4        # both pads are seen and empty
    TOO_MANY_MOVES = 5


class Order(NamedTuple):
    """What to do now."""

    kind: str                # 'wait', 'move', 'done', 'give_up'
    correction: object = None
    reason: Reason = Reason.NOT_GIVEN_UP


class GraspLoop:
    """Follows one grasp from its first closing. Times are of a steady clock [s]."""

    def __init__(self, patience: float = PATIENCE, max_moves: int = MAX_MOVES):
        self._patience = patience
        self._max_moves = max_moves
        self._closed_at = float('inf')
        self.moves = 0

    def closed(self, now: float) -> None:
        """The gripper has closed at a light force."""
        self._closed_at = now

    def next(self, correction, now: float) -> Order:
        """Decide by what the planner decided at ``now``."""
        since = now - self._closed_at
        if since < SETTLE:
            return Order('wait')
        if correction.action == 'lift':
            return Order('done', correction)
        if correction.action in MOVES:
            if self.moves >= self._max_moves:
                return Order('give_up', reason=Reason.TOO_MANY_MOVES)
            self.moves += 1
            self._closed_at = float('inf')  # no decision counts until it has closed again
            return Order('move', correction)
        if since < self._patience:
            return Order('wait')
        reasons = {'hold': Reason.NOT_SEEN, 'open': Reason.EMPTY}
        return Order('give_up', reason=reasons.get(correction.action, Reason.NO_DECISION))
