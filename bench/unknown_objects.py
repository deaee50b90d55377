"""Draw objects whose width a planner knows to 5 mm, and whose mass, friction and strength the planner does not know.

The distribution was fixed before the first run of bench_unknown.py. The shapes are those of the simulated gripper's
items. For each object, a force of at most MOST_FORCE carries MARGIN times the largest load without breaking the object.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from bench_grasps import start_of

from examples.simulated_gripper.items import ITEMS, Item
from examples.simulated_gripper.world import GRAVITY, Place

SHAPES = ('circle', 'square', 'rectangle', 'right_triangle', 'isosceles_triangle', 'ball', 'bottle', 'bar')
MASS = (0.02, 1.0)       #: drawn log-uniformly [kg]
FRICTION = (0.2, 0.8)    #: friction coefficient, drawn log-uniformly
STRENGTH = (4.0, 40.0)   #: force of a pad at which the object breaks, drawn log-uniformly [N]
PULL = (0.5, 2.0)        #: force that pulls the object down, drawn uniformly [weights]
WIDTH_ERROR = 0.005      #: largest error of the known width [m]
SHAKE = 1.0              #: acceleration of the shake [g]
MOST_FORCE = 9.0         #: largest force of a pad that any gripper of the benchmark uses [N]
MARGIN = 1.5             #: load that the allowed force carries at least [largest load]


class UnknownObject(NamedTuple):
    """An object at its initial place."""

    name: str           #: name of the shape
    item: Item
    place: Place
    known_width: float  #: width that the planner knows [m]
    pull: float         #: force that pulls the object down [N]
    need: float         #: force of each pad at which friction just carries the largest load [N]

    @property
    def allowed(self) -> float:
        """Largest force of each pad that the gripper can use without breaking the object [N]."""
        return min(self.item.strength, MOST_FORCE)

    @property
    def best_force(self) -> float:
        """Force of each pad, the geometric mean of the needed and the allowed force [N]."""
        return float(np.sqrt(self.need * self.allowed))


def unknown_object(seed: int) -> UnknownObject:
    """Draw the object of a seed. Eight consecutive seeds have eight different shapes."""
    random, name = np.random.default_rng((49, seed)), SHAPES[seed % len(SHAPES)]
    item, place = ITEMS[name], start_of(name, seed)
    known_width = item.width + random.uniform(-WIDTH_ERROR, WIDTH_ERROR)
    while True:
        mass, friction, strength = (float(np.exp(random.uniform(*np.log(limits))))
                                    for limits in (MASS, FRICTION, STRENGTH))
        weights = random.uniform(*PULL)
        weight = mass * GRAVITY
        need = (1 + max(SHAKE, weights)) * weight / (2 * friction)
        drawn = UnknownObject(name, replace(item, mass=mass, friction=friction, strength=strength), place, known_width,
                              weights * weight, need)
        if MARGIN * need <= drawn.allowed:
            return drawn
