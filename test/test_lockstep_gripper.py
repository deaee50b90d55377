"""The rules of the gripper in lockstep with the physics of a held object."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from lockstep_gripper import LockstepGripper

from examples.simulated_gripper.items import ITEMS
from examples.simulated_gripper.world import GRAVITY, Outcome, World
from tactile_node.gripper.rules.closing import Outcome as Ending
from tactile_node.gripper.rules.touch_settings import TouchSettings

RULES = {'widest': 0.085, 'stiffness': 1000.0, 'latency': 0.1, 'fast_speed': 0.01, 'slow_speed': 0.003}


@pytest.mark.skipif(find_spec('mujoco') is None,
                    reason='MuJoCo is not installed: pip install -r requirements/bench_physics.txt')
@pytest.mark.long
@pytest.mark.parametrize(('hold', 'outcome'), [(False, Outcome.DROPPED), (True, Outcome.HELD)])
def test_a_pulled_object_is_held_only_if_the_force_rises(hold, outcome):
    """Friction needs 2 N on each pad for the weight, and 3 N under the pull. The gripper closes with 2.4 N."""
    item = replace(ITEMS['square'], mass=2 / GRAVITY, friction=0.5)
    world = World(item)
    settings = TouchSettings(**RULES, hold=hold, slide_force_step=1.0, hold_travel=0.02)
    gripper = LockstepGripper(world, settings, np.random.default_rng(0))
    gripper.follow(0.3)
    assert gripper.close(2.4) is Ending.FORCE_REACHED
    gripper.follow(1.0, lift_speed=0.02)
    assert world.outcome is Outcome.HELD
    world.pull(0.005, 1.0)
    gripper.follow(6.0, until=lambda: world.outcome is Outcome.DROPPED)
    assert world.outcome is outcome
