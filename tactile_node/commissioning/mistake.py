"""Name the mistakes that a person can make during commissioning, and the error that asks for a repeat."""

from enum import Enum

from tactile_node.errors import TactileError


class Mistake(Enum):
    """Reason why a step is repeated."""

    WRONG_PAD = 'wrong pad'
    WRONG_CORNER = 'wrong corner'
    TOO_LIGHT = 'pressed too lightly'
    LET_GO_EARLY = 'let go too early'
    TWO_FINGERS = 'pressed with two fingers'
    OTHER_BLOCK = 'block of another size'
    BLOCK_ASKEW = 'block askew'
    BLOCK_OFF_CENTRE = 'block at the edge of a pad'
    BLOCK_SLID = 'block has slid'
    BLOCK_MISSING = 'block missing'
    HAND_BETWEEN = 'something touched the pads'
    SWITCHED_OFF = 'gripper switched off'
    EMERGENCY_STOP = 'gripper does not move'
    COMMAND_REJECTED = 'command rejected'
    OTHER_CLIENT = 'another node commands the gripper'
    OTHER_JOINT = 'joint states of another joint'
    WRONG_DIRECTION = 'contradictory directions'
    PULLED_OUT = 'object pulled out'
    WEIGHT_MISSING = 'weight not hung'
    PADS_SILENT = 'no frames from a pad'
    OTHER_RATE = 'other frame rate than in the record'
    NO_CONSENT = 'no consent'


class RefusedStepError(TactileError):
    """A step of the commissioning cannot be used and has to be repeated. ``mistake`` gives the reason."""

    def __init__(self, where: str, mistake: Mistake, *, expected: str, got: str, remedy: str):
        super().__init__(where, expected=expected, got=got, remedy=remedy)
        self.mistake = mistake
