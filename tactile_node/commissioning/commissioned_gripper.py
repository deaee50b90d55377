"""Describe what a commissioning needs from the gripper, the pads and the person."""

from enum import Enum
from typing import NamedTuple, Protocol

from tactile_node.commissioning.recording import Recording


class CommissionedGripper(Protocol):
    """A gripper with two pads. A ROS adapter or a simulation implements it."""

    def now(self) -> float:
        """Return the time, on the clock of the recordings [s]."""

    def advance(self, seconds: float) -> Recording:
        """Wait, and return everything that was received meanwhile."""

    def command(self, position: float, effort: float, speed: float) -> None:
        """Send a goal, in the units of the joint and of the gripper's effort."""

    def cancel(self) -> None:
        """Cancel all goals."""

    def serial_numbers(self) -> tuple[str, str]:
        """Return the serial number of each pad, or '' if it is not known."""

    def others(self) -> str:
        """Return the other client that commands the gripper, for example touch_gripper, or '' if there is none."""


class Act(Enum):
    """Action that a question asks of the person."""

    CONFIRM_STOP = 'confirm that the emergency stop is in reach'
    CONSENT = 'consent to a series of movements'
    LEAVE = 'leave the pads untouched'
    PRESS = 'press one place of a pad'
    STROKE = 'press everywhere on a pad'
    DIRECTION = 'say how the fingers have moved'
    FOAM = 'hold foam between the pads'
    BLOCK = 'hold a block between the pads'
    CLEAR = 'take everything out of the gripper'
    WEIGHT = 'hang the weight on the object'
    OBJECT = 'hold the object between the pads'
    JIG = 'set the jig with a block on the palm'
    MEASURE = 'measure where the gripper holds the block'
    REUSE = 'say whether a recording is used again'
    REPEAT = 'correct a mistake before a part is repeated'

    @property
    def prompt(self) -> str:
        """Words that ask for the answer. The recording of some acts begins with the answer."""
        if self in (Act.LEAVE, Act.PRESS, Act.STROKE):
            return 'Press Enter, and then do this'
        return 'Press Enter to repeat this part' if self is Act.REPEAT else 'Press Enter when this is done'


DIRECTIONS = 'opened', 'closed', 'not moved'  #: Choices of the question how the fingers have moved.


class Question(NamedTuple):
    """A question to the person."""

    act: Act
    text: str
    choices: tuple[str, ...] = ('done',)
    pad: str = ''        #: name of the pad to press
    place: str = ''      #: place on this pad
    width: float = 0.0   #: width of the block [m]


class Person(Protocol):
    """The person at the gripper."""

    def ask(self, question: Question) -> str:
        """Return one of the choices of the question."""
