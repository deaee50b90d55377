"""Simulate an object that is put down on a table, as two pads of an elastic skin read it.

The arm lowers the object at a constant speed. Before the contact, the pads carry the weight of the object. After the
contact, the load along the pads falls with the way of the hand, because the pads, the fingers and the arm yield. The
load then rises in the other direction, until the object slips in the hand.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from event_world import PITCH, QUIET, RATE, Path, Scene, random_skin

from tactile_node.grasp.tracker import GraspContact
from tactile_node.gripper.rules.put_down import HeldContact, HeldReading
from tactile_node.pose.pipeline import ContactPipeline, Taxels
from tactile_node.shape.methods import VisibilityGuard

FRICTION = 0.5      #: Load along a pad at which the object slips [normal force].
#: Force on the table per metre by which the hand moves: the skins, the fingers and the arm yield together [N/m].
STIFFNESS = 5000.0
GRIP = 5.0  #: Normal force of each pad [N].


class Descent(NamedTuple):
    """An object that is lowered onto a table."""

    weight: float  #: weight on each pad [normal force]
    speed: float   #: speed of the hand [m/s]
    met: float     #: time at which the object meets the table [s]

    @property
    def most(self) -> float:
        """Largest force on the table [N]."""
        return 2 * GRIP * (self.weight + FRICTION)

    def pressed(self, time: float) -> float:
        """Return the force on the table at a time [N], if the hand does not stop."""
        return min(max(0.0, STIFFNESS * self.speed * (time - self.met)), self.most)

    def path(self, time: float) -> dict[str, float]:
        """Return the load [normal force], and how far the object has slipped [pitches]."""
        load = self.weight - self.pressed(time) / (2 * GRIP)
        slips_from = self.met + self.most / (STIFFNESS * self.speed)
        return {'load': load, 'dx': -max(0.0, time - slips_from) * self.speed / PITCH}


class Hand:
    """Two pads with independent noise that hold one kind of object. No outline is fitted, so no angle is known."""

    def __init__(self, rng: np.random.Generator, kind: str, recogniser: VisibilityGuard):
        skin = random_skin(rng)
        self._scenes = [Scene(rng, kind, skin=skin) for _ in range(2)]
        self._pipelines = [ContactPipeline(recogniser) for _ in range(2)]

    def see(self, path: Path, seconds: float) -> Iterator[HeldReading]:
        """Yield the readings while the load and the place change along ``path``."""
        for number in range(round(seconds * RATE)):
            time = number / RATE
            values = [self._values(scene, path(time), time) for scene in self._scenes]
            left, right = (self._contact(*pad) for pad in zip(self._pipelines, values))
            yield HeldReading(time, GraspContact.TWO_SIDED, (left, right), (number + 1, number + 1))

    @staticmethod
    def _values(scene: Scene, place: dict[str, float], time: float) -> np.ndarray:
        way = place['dx']
        place = QUIET | place | {'dx': way * np.cos(scene.direction), 'dy': way * np.sin(scene.direction)}
        return scene.values(time, **place)

    @staticmethod
    def _contact(pipeline: ContactPipeline, values: np.ndarray) -> HeldContact:
        moments = pipeline.find(values, Taxels(PITCH, 'Pa')).moments
        return HeldContact(moments.centre_of_pressure, moments.force, PITCH)
