"""Lower an arm until something touches the held object, then open the gripper if the arm feels the contact too.

    outcome = put_down(client, arm, highest_table=0.05)       # client: TouchClient; arm: an object like Arm below

The arm stops as soon as the feedback of the gripper node ceases, so it stops within 0.2 s after the node has died. The
pads cannot tell a table from a hand that pushes the object (docs/put_down.md). The example therefore opens the gripper
only if the arm's own contact signal has changed too. A signal that was on from the beginning is no witness.
"""

import time
from collections.abc import Callable
from typing import Protocol

import rclpy
from rclpy.node import Node

from tactile_node.gripper.put_down_goal import PutDownGoal
from tactile_node.gripper.touch_client import TouchClient
from tactile_skin.action import PutDown

SPEED = 0.002     # speed at which the arm is lowered [m/s]
PERIOD = 0.01     # time between two looks at the state of the goal [s]
TIMEOUT = 60.0    # time allowed for the goal [s]
GONE = 3.0        # time without feedback after which the node counts as gone [s]
WITNESSED = 0.5   # longest time between the touch on the pads and the arm's own contact [s]
WIDEST = 0.08     # opening of the fully open gripper, in the gripper's own unit


class Arm(Protocol):
    """The arm that carries the gripper."""

    def height(self) -> float:
        """Return the height of the object's lower side [m]."""

    def lower(self, speed: float) -> None:
        """Lower the arm at ``speed`` [m/s] until the next call. A speed of 0 stops the arm."""

    def feels_contact(self) -> bool:
        """Return True if the arm's own sensor feels a contact, for example in the torques of its joints."""


class Witness:
    """Remembers when the arm's own contact signal has changed from off to on."""

    def __init__(self, arm: Arm, steady: Callable[[], float]):
        self._arm, self._steady = arm, steady
        self._was_off, self._changed = False, -float('inf')

    def look(self) -> None:
        feels = self._arm.feels_contact()
        if feels and self._was_off:
            self._changed = self._steady()
        self._was_off = not feels

    def agrees(self) -> bool:
        """Return True if the signal changed within the last WITNESSED, and is still on."""
        return not self._was_off and self._steady() - self._changed <= WITNESSED


def may_lower(goal: PutDownGoal, arm: Arm, highest_table: float) -> bool:
    """Return True if the arm may move. During the baseline, it must stay above the highest possible table."""
    return goal.is_watching or (goal.is_current and arm.height() > highest_table)


def put_down(client: TouchClient, node: Node, arm: Arm, highest_table: float,
             steady: Callable[[], float] = time.monotonic) -> PutDown.Result | None:
    """Lower the arm until the goal ends, and return its result, or None if the node is gone. The arm has stopped."""
    goal, witness, began = client.put_down(TIMEOUT), Witness(arm, steady), steady()
    try:
        while goal.result is None and steady() - max(goal.heard, began) < GONE:
            rclpy.spin_once(node, timeout_sec=PERIOD)
            witness.look()
            arm.lower(SPEED if may_lower(goal, arm, highest_table) else 0.0)
    finally:
        arm.lower(0.0)
        if goal.result is None and goal.handle is not None:
            goal.cancel()  # so that the gripper node holds the force again
    if goal.result is None or goal.result.outcome != PutDown.Result.SOMETHING_TOUCHES:
        return goal.result
    until = steady() + WITNESSED
    while not witness.agrees() and steady() < until:  # the arm may feel the table later than the pads
        rclpy.spin_once(node, timeout_sec=PERIOD)
        witness.look()
    if witness.agrees():
        client.wait(client.send(position=WIDEST), TIMEOUT, spin=True)
    return goal.result
