"""Describe the gripper as its data sheet does, and state how much is measured."""

from dataclasses import dataclass

from tactile_node.commissioning.recording import PadGrid
from tactile_node.errors import ConfigurationError


@dataclass(frozen=True)
class GaugeBlock:
    """A block with two parallel faces."""

    width: float   #: distance of its faces, as measured with a calliper [m]
    length: float  #: length of each face, by which the skin recognises the block [m]


@dataclass(frozen=True)
class CommissioningPlan:
    """The plan of a commissioning.

    Raises
    ------
    ConfigurationError
        Raised if the limits of the joint or the largest effort are impossible.
    """

    grid: PadGrid
    joint: str
    unit: str             #: unit of the joint: 'm', 'rad' or 'percent'
    low: float            #: lower limit of the joint, from the data sheet
    high: float           #: upper limit of the joint
    most_effort: float    #: largest effort that the gripper accepts, in its own unit
    blocks: tuple[GaugeBlock, ...]
    weight: float         #: weight for the shift of a contact [N]
    pads: tuple[str, str] = ('left', 'right')  #: names of the pads in the driver
    down: tuple[float, float] = (0.0, -1.0)  #: direction of gravity on the left pad, seen with the fingertip up
    force_limit: float = 20.0  #: largest force that the commissioning applies on purpose [N]
    touch_force: float = 5.0   #: force of the closes that prove the parameters [N]
    overshoot: float = 2.0     #: predicted overshoot of these closes [N]
    rest_time: float = 300.0   #: duration of the recording of the untouched pads [s]
    hold_time: float = 60.0    #: time for which the force is watched after the last command [s]
    stop_trials: int = 20      #: number of trials of each way to stop
    closes: int = 10           #: number of closes that prove the parameters
    shift_grips: int = 2       #: number of grips with the weight
    #: Pose of the block in the jig in the frame of the gripper: x, y, z [m], and roll, pitch, yaw [rad]; empty without
    #: a jig.
    jig: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (self.low < self.high and self.most_effort > 0):
            raise ConfigurationError('limits of the gripper', expected='low < high, and an effort above 0',
                                     got=f'{self.low:g}, {self.high:g}, {self.most_effort:g}',
                                     remedy='Take the limits from the data sheet of the gripper.')

    @property
    def jig_block(self) -> GaugeBlock:
        """The block that stands in the jig. The block of the shortest face also lies flat on tilted pads."""
        return min(self.blocks, key=lambda block: block.length)

    @property
    def middle_block(self) -> GaugeBlock:
        return self.blocks[len(self.blocks) // 2]

    @property
    def travel(self) -> float:
        return self.high - self.low
