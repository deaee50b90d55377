"""Settings of the rules for closing and holding, which are also parameters of the gripper node."""

from dataclasses import dataclass

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.opening import HIGHEST_GAP
from tactile_node.parameter import parameter


@dataclass(frozen=True)
class TouchSettings:
    """Settings of the rules. The gripper node checks the range of each parameter.

    Raises
    ------
    ConfigurationError
        Raised if ``stop_by`` is unknown, if two limits contradict each other, or if the overshoot at ``fast_speed``
        exceeds ``touch_force``.
    """

    stop_by: str = parameter('cancel', "way to stop the gripper: cancel (cancel the gripper's action), or goal (send a "
                             'goal at the present position)')
    answer_timeout: float = parameter(0.5, 'time allowed for the gripper to accept a command and to confirm a stop [s]',
                                      0.02, 60)
    widest: float = parameter(0.08, 'jaw opening when the gripper is fully open [m]; a goal of at least this opening '
                              'opens the gripper, unless the gripper is measured to be wider', 1e-3, HIGHEST_GAP)
    fast_speed: float = parameter(0.02, 'closing speed until the first touch [m/s]; for a GripperCommand, give the '
                                  "gripper's own speed", 1e-5, 10)
    slow_speed: float = parameter(0.005, 'closing speed after the first touch, or below slow_from [m/s]', 1e-5, 10)
    slow_from: float = parameter(0.0, 'opening below which the gripper closes slowly [m]; 0: the gripper closes slowly '
                                 'only after the first touch', 0, HIGHEST_GAP)
    touch_force: float = parameter(2.0, 'force limit for a goal without effort: the gripper closes until both pads are '
                                   'touched or the more strongly pressed pad reaches this force [N]', 1e-3, 1e4)
    highest_force: float = parameter(20.0, 'maximum effort that a goal may have [N]', 1e-3, 1e4)
    edge_share: float = parameter(0.5, 'fraction of the force that a pad is assumed to measure if its contact extends '
                                  'beyond the pad', 0.01, 1)
    one_sided_travel: float = parameter(0.02, 'travel for which the gripper keeps closing while only one pad is '
                                        'touched [m]; 0: the gripper stops immediately', 0, HIGHEST_GAP)
    max_age: float = parameter(0.15, "age of the pads' data above which the gripper stops [s]", 1e-3, 10)
    latency: float = parameter(0.06, 'time from a touch until the gripper stops [s]', 1e-3, 10)
    stiffness: float = parameter(1000.0, 'stiffness of pads and object together, as force per metre of opening [N/m]; '
                                 'with latency, the stiffness limits the speed', 1, 1e7)
    hold: bool = parameter(False, 'true: after a goal with an effort that ended as FORCE_REACHED, keep adjusting the '
                           'opening so that the force stays the same')
    gripper_step: float = parameter(1e-4, 'smallest change of the opening that the gripper can make [m]; with '
                                    'stiffness and slow_speed, this step determines how accurate the force is', 1e-6,
                                    0.01)
    hold_travel: float = parameter(0.005, 'total travel of all corrections after which a hold ends [m]', 1e-5,
                                   HIGHEST_GAP)
    slide_force_step: float = parameter(0.0, 'step by which the held force rises if the object slides in one direction '
                                        '[N]; at most one step per second, up to highest_force; 0: the force never '
                                        'rises', 0, 1e4)

    def __post_init__(self) -> None:
        if self.stop_by not in ('cancel', 'goal'):
            raise ConfigurationError('stop_by', expected='cancel or goal', got=repr(self.stop_by),
                                     remedy='Test whether the gripper stops when its action is cancelled.')
        if not (self.slow_speed <= self.fast_speed and self.touch_force <= self.highest_force):
            raise ConfigurationError(
                'limits of closing', expected='slow_speed <= fast_speed, touch_force <= highest_force',
                got=str(self), remedy='Correct the parameters of the gripper node.')
        if self.overshoot(self.fast_speed) > self.touch_force:
            raise ConfigurationError(
                'fast_speed', expected=f'at most {self.fastest(self.touch_force):.3g} m/s, at which latency x speed x '
                f'stiffness is the touch_force of {self.touch_force:g} N',
                got=f'{self.fast_speed:g} m/s: {self.latency:g} s x {self.fast_speed:g} m/s x {self.stiffness:g} N/m '
                f'= {self.overshoot(self.fast_speed):.3g} N', remedy='Close more slowly, or allow more force.')

    def overshoot(self, speed: float) -> float:
        """Return the force that builds up from a touch until the gripper stops [N]."""
        return self.latency * speed * self.stiffness

    def fastest(self, force: float) -> float:
        """Return the speed at which the overshoot is ``force`` [m/s]."""
        return force / (self.latency * self.stiffness)
