"""Measure a block that the gripper holds with rising effort.

The gripper stalls on the block at several efforts. For each stall, the joint shows how far the gripper has closed, and
each taxel shows its share of the force. A taxel's force rises linearly from the reading at which the block touches the
taxel. These readings form a plane over the pad. The plane gives the reading at which the skins just touch the block,
and the tilt between the pads. Neither depends on the gain of a taxel or on how the gripper rounds its commands.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tactile_node.commissioning.measurement import NOT_MEASURED, Estimate, jackknife
from tactile_node.commissioning.mistake import Mistake, RefusedStepError

LEAST_LOAD = 0.01       #: Smallest force of a taxel that is used [N].
LEAST_STALLS = 3        #: Smallest number of stalls at which a taxel must carry a load.
LEAST_TAXELS = 8        #: Smallest number of loaded taxels on a pad.
COVERED_SHARE = 0.5     #: A taxel lies on the block if its stiffness is this share of the median of the stiffest half.
UPPER_SHARE = 0.35      #: The stiffness is that above this share of the largest force.
WHOLE_SHARE = 0.75      #: A taxel that is covered wholly has this share of the typical stiffness.
LENGTH_ERROR = 0.0022   #: Largest difference between the length of a face and of its print on the skin [m].
MOST_SKEW = 0.1         #: Largest difference between the slopes of a free block against the two pads [rad].
MOST_SLID = 0.0007      #: Largest movement of the block between two stalls [m].
MIRROR = np.diag((-1.0, 1.0))  #: Converts (x, y) on the right pad, which faces the left one, to directions on the left.


class Stall(NamedTuple):
    """The gripper at rest against an object."""

    effort: float
    reading: float                           #: position of the joint
    images: tuple[np.ndarray, np.ndarray]    #: mean force on each taxel of the left and the right pad [N]

    @property
    def forces(self) -> tuple[float, float]:
        """Force on the left and on the right pad [N]."""
        left, right = (float(np.nansum(image)) for image in self.images)
        return left, right

    @property
    def force(self) -> float:
        """Mean force of both pads [N]."""
        return sum(self.forces) / 2


class Print(NamedTuple):
    """The print of a block on a pad, in the frame of the pad seen with the fingertip up."""

    centre: np.ndarray  #: (x, y) from the centre of the pad [m]
    angle: float        #: direction of the longer side, from -pi/2 to pi/2 [rad]


class BlockFace(NamedTuple):
    """The covered part of a pad under a block, in the frame of the pad seen with the fingertip up.

    Unlike a `Print`, the face does not depend on the forces, which a tilted pad shares unevenly.
    """

    centre: np.ndarray  #: (x, y) from the centre of the pad [m]
    angle: float        #: direction of the longer side, from -pi/2 to pi/2 [rad]
    slopes: np.ndarray  #: change of the reading at which the taxels touch the block, along x and y, (2,) [reading/m]


class BlockGrip(NamedTuple):
    """A block between the pads."""

    width: float              #: width of the block, as the person measured it [m]
    onset: Estimate           #: reading at which the pads touch the block at the centre of the left pad
    slopes: np.ndarray        #: change of this reading along x and y of the left pad, (2,) [reading/m]
    prints: tuple[Print, Print]
    stiffness: Estimate       #: force per change of the reading, over the larger forces [N/reading]
    efforts: tuple[float, ...]  #: effort of each stall
    forces: tuple[float, ...]   #: mean force of both pads in each stall [N]
    imbalance: float            #: half the difference between the forces on both pads, as a share of their mean


def measure_grip(stalls: Sequence[Stall], places: tuple[np.ndarray, np.ndarray], width: float, length: float,
                 metres: float, most_skew: float) -> BlockGrip:
    """Return the measured grip of a block.

    Parameters
    ----------
    stalls : sequence of Stall
        Stalls with rising effort.
    places : tuple of np.ndarray
        Place of each taxel on the left and the right pad, as in `taxel_places`.
    width, length : float
        Width of the block, and length of its faces on the pads [m].
    metres : float
        Rough change of the opening per unit of the reading, with its sign, for the checks.
    most_skew : float
        Largest difference between the slopes of the block against the two pads [rad].

    Raises
    ------
    RefusedStepError
        Raised if the block is missing, askew, at the edge, of another size, or slides.
    """
    where = f'block of {1e3 * width:g} mm'
    if len(stalls) < LEAST_STALLS + 1 or max(stall.force for stall in stalls) < LEAST_LOAD * LEAST_TAXELS:
        raise RefusedStepError(where, Mistake.BLOCK_MISSING, expected='a force on both pads', got='none',
                               remedy='Hold the block between the pads until the gripper holds it.')
    _check_still(stalls, places, where)
    planes = [_TaxelLines.of(stalls, number, places[number]) for number in (0, 1)]
    if min(len(plane.places) for plane in planes) < LEAST_TAXELS:
        raise RefusedStepError(where, Mistake.BLOCK_ASKEW, expected='a face of the block on each pad',
                               got='a few loaded taxels', remedy='Lay the faces of the block flat on both pads.')
    left, right = (plane.plane() for plane in planes)
    skew = float(np.abs((left - right * (1, -1, 1))[1:]).max() * abs(metres))
    if skew > most_skew:
        raise RefusedStepError(where, Mistake.BLOCK_ASKEW, expected='a block that lies flat on both pads',
                               got=f'{np.degrees(skew):.0f} degrees between the block and the pads',
                               remedy='Let go of the block once the gripper holds it.')
    for plane, pad in zip(planes, places):
        plane.check_face(pad, length, where)

    def of_left(used: np.ndarray) -> np.ndarray:
        lines = _TaxelLines.of([stalls[k] for k in used], 0, places[0])
        return lines.plane()[:1]
    onset = jackknife(of_left, len(stalls), 2)[0]
    tilt = (left[1:] + right[1:] * (-1, 1)) / 2
    prints = tuple(print_of(stalls[-1].images[number], places[number]) for number in (0, 1))
    return BlockGrip(width, onset, tilt, (prints[0], prints[1]), stiffness_of(stalls),
                     tuple(stall.effort for stall in stalls), tuple(stall.force for stall in stalls),
                     float(np.mean([np.diff(stall.forces)[0] / 2 / stall.force for stall in stalls])))


def measure_faces(stalls: Sequence[Stall], places: tuple[np.ndarray, np.ndarray]) -> tuple[BlockFace, BlockFace]:
    """Return the faces of a block on the left and on the right pad, from stalls that `measure_grip` has checked."""
    left, right = (_TaxelLines.of(stalls, number, places[number]).face() for number in (0, 1))
    return left, right


def stiffness_of(stalls: Sequence[Stall]) -> Estimate:
    """Return the force per change of the reading over the larger forces."""
    forces = np.array([stall.force for stall in stalls])
    readings = np.array([stall.reading for stall in stalls])
    used = forces >= forces.max() * UPPER_SHARE
    if np.count_nonzero(used) < 3:
        return NOT_MEASURED
    x, y = readings[used], forces[used]
    return jackknife(lambda k: np.array([abs(np.polyfit(x[k], y[k], 1)[0])]), len(x), 2)[0]


def print_of(image: np.ndarray, places: np.ndarray) -> Print:
    """Return the print that the forces on a pad show, by its moments."""
    forces = np.nan_to_num(image).ravel()
    weights = np.where(forces >= LEAST_LOAD, forces, 0)
    centre, spread = _moments(places.reshape(-1, 2), weights)
    return Print(centre, _direction(spread))


def _moments(places: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean of places with weights, (2,), and their covariance, (2, 2)."""
    weights = weights / max(float(weights.sum()), 1e-9)
    centre = weights @ places
    return centre, (places - centre).T @ ((places - centre) * weights[:, np.newaxis])


def _direction(spread: np.ndarray) -> float:
    """Return the direction of the longer side of a covariance [rad]."""
    (xx, xy), (_, yy) = spread
    return float(np.arctan2(2 * xy, xx - yy) / 2)


def repair(image: np.ndarray, is_faulty: np.ndarray) -> np.ndarray:
    """Return an image in which each faulty taxel has the mean of its working neighbours."""
    fixed = np.array(image, float)
    for row, col in np.argwhere(is_faulty):
        around = (slice(max(row - 1, 0), row + 2), slice(max(col - 1, 0), col + 2))
        working = fixed[around][~is_faulty[around]]
        fixed[row, col] = working.mean() if working.size else 0.0
    return fixed


class _TaxelLines(NamedTuple):
    """The line of force over reading of each loaded taxel of a pad."""

    places: np.ndarray   # (N, 2) [m]
    onsets: np.ndarray   # reading at which the taxel is touched, (N,)
    slopes: np.ndarray   # force per reading, (N,) [N/reading]
    weights: np.ndarray  # inverse standard deviation of each onset up to a factor, (N,)

    @classmethod
    def of(cls, stalls: Sequence[Stall], pad: int, places: np.ndarray) -> '_TaxelLines':
        forces = np.array([stall.images[pad].ravel() for stall in stalls])
        readings = np.array([stall.reading for stall in stalls])[:, np.newaxis]
        is_loaded = np.nan_to_num(forces) >= LEAST_LOAD
        count = is_loaded.sum(0)
        some = np.maximum(count, 1)
        mean_reading = (readings * is_loaded).sum(0) / some
        mean_force = np.where(is_loaded, forces, 0).sum(0) / some
        apart = np.where(is_loaded, readings - mean_reading, 0)
        spread = (apart ** 2).sum(0)
        slope = (apart * np.where(is_loaded, forces, 0)).sum(0) / np.where(spread > 0, spread, 1)
        used = (count >= min(LEAST_STALLS, len(stalls) - 1)) & (spread > 0) & (slope != 0)
        used &= np.sign(slope) == np.sign(np.median(slope[used])) if used.any() else False
        lever = mean_force[used] / slope[used]
        weight = np.abs(slope[used]) / np.sqrt(1 / count[used] + lever ** 2 / spread[used])
        return cls(places.reshape(-1, 2)[used], mean_reading[used] - lever, slope[used], weight)

    @property
    def level(self) -> float:
        """Typical stiffness of a wholly covered taxel [N/reading]."""
        stiffness = np.sort(np.abs(self.slopes))
        return float(np.median(stiffness[stiffness.size // 2:]))

    def plane(self) -> np.ndarray:
        """Return the onset at the centre of the pad, and its slopes along x and y, (3,).

        A taxel that the block covers partly is left out, because its centre lies beside the covered part.
        """
        stiffness = np.abs(self.slopes)
        weights = np.where(stiffness >= WHOLE_SHARE * self.level, self.weights, 0.0)
        system = np.column_stack((np.ones(len(self.places)), self.places)) * weights[:, np.newaxis]
        plane: np.ndarray = np.linalg.lstsq(system, self.onsets * weights, rcond=None)[0]
        return plane

    def face(self) -> BlockFace:
        """Return the covered part of the pad."""
        centre, spread = _moments(self.places, np.minimum(np.abs(self.slopes) / self.level, 1.0))
        return BlockFace(centre, _direction(spread), self.plane()[1:])

    def check_face(self, pad: np.ndarray, length: float, where: str) -> None:
        """Raise RefusedStepError if the covered taxels reach the edge of the pad or have another length."""
        stiffness = np.abs(self.slopes)
        level = self.level
        covered = self.places[stiffness >= COVERED_SHARE * level]
        pitch = float(np.linalg.norm(pad[0, 1] - pad[0, 0]))
        limits = np.abs(pad.reshape(-1, 2)).max(0) - pitch / 2
        if (np.abs(covered) > limits).any():
            raise RefusedStepError(where, Mistake.BLOCK_OFF_CENTRE, expected='a block in the middle of the pads',
                                   got='a block at the edge of a pad', remedy='Put the block in the middle.')
        _, spread = _moments(self.places, np.minimum(stiffness / level, 1.0))
        variance = np.linalg.eigvalsh(spread)[-1]
        found = float(np.sqrt(12 * max(variance - pitch ** 2 / 12, 0)))
        if abs(found - length) > LENGTH_ERROR:
            raise RefusedStepError(where, Mistake.OTHER_BLOCK, expected=f'a face of {1e3 * length:.1f} mm length',
                                   got=f'{1e3 * found:.1f} mm',
                                   remedy='In the repeat, insert the block that the text names.')


def _check_still(stalls: Sequence[Stall], places: tuple[np.ndarray, np.ndarray], where: str) -> None:
    """Raise RefusedStepError if the block has moved during the second half of the stalls."""
    later = stalls[len(stalls) // 2:]
    for number in (0, 1):
        centres = np.array([print_of(stall.images[number], places[number]).centre for stall in later])
        moved = float(np.linalg.norm(np.diff(centres, axis=0), axis=1).max())
        if moved > MOST_SLID:
            raise RefusedStepError(where, Mistake.BLOCK_SLID, expected='a block at rest',
                                   got=f'a movement by {1e3 * moved:.1f} mm', remedy='Let go of the block.')
