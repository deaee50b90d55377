"""Loop that closes, asks examples/planner_client.py and moves, until the contacts are opposite or the loop gives up.

The loop only turns the planner's decisions into orders. Your program moves the gripper:

    loop = GraspLoop()
    loop.closed(now)                                  # after closing with a light force, 2 N
    order = loop.next(planner.decide(now), now)       # as often as you like
    'wait': ask again; 'move': open, move by order.correction, close, loop.closed(now); 'done': squeeze and lift;
    'give_up': do not squeeze; order.reason names the reason
"""

from enum import IntEnum
from typing import NamedTuple

SETTLE = 0.4      # wait after closing before decisions count [s], longer than MAX_AGE to exclude older data
PATIENCE = 5.0    # time limit for a decision after closing [s]
MAX_MOVES = 12    # largest number of moves before the loop gives up
MOVES = ('shift', 'rotate', 'tilt', 'regrasp')


class Reason(IntEnum):
    """Reasons why the loop gave up."""

    NOT_KNOWN = 0
    NOT_GIVEN_UP = 1
    NOT_SEEN = 2     # nothing was known about the object in the gripper
    NO_DECISION = 3  # a contact was missing, was never stable, or was cut off by the edge of only one pad
    EMPTY = 4        # both pads were reported as empty
    TOO_MANY_MOVES = 5


class Order(NamedTuple):
    """The next step for the gripper."""

    kind: str                # 'wait', 'move', 'done', 'give_up'
    correction: object = None
    reason: Reason = Reason.NOT_GIVEN_UP


class GraspLoop:
    """Follows one grasp, starting when the gripper first closes. All times come from a steady clock [s]."""

    def __init__(self, patience: float = PATIENCE, max_moves: int = MAX_MOVES):
        self._patience = patience
        self._max_moves = max_moves
        self._closed_at = float('inf')
        self.moves = 0

    def closed(self, now: float) -> None:
        """Tell the loop that the gripper has closed with a light force."""
        self._closed_at = now

    def next(self, correction, now: float) -> Order:
        """Return the next step, given the planner's ``correction`` at the time ``now``."""
        since = now - self._closed_at
        if since < SETTLE:
            return Order('wait')
        if correction.action == 'lift':
            return Order('done', correction)
        if correction.action in MOVES:
            if self.moves >= self._max_moves:
                return Order('give_up', reason=Reason.TOO_MANY_MOVES)
            self.moves += 1
            self._closed_at = float('inf')  # no decision counts until the gripper has closed again
            return Order('move', correction)
        if since < self._patience:
            return Order('wait')
        reasons = {'hold': Reason.NOT_SEEN, 'open': Reason.EMPTY}
        return Order('give_up', reason=reasons.get(correction.action, Reason.NO_DECISION))
