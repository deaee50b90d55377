"""Touches -> patches to learn from: each frame as it is, and the same contact at other angles, places and noise.

The recorded values are interpolated, so that what a head sees is what the skin read. Patches need no mirrored ones: a
patch is the same for a contact and its mirror image (shape/patch.py).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.on_off import are_on_off
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.shape.patch import Patch, joined, make_patch
from tactile_node.teaching.touches import Touch, TouchFrame

VARIANTS = 16           #: of each touch
SIZE = 0.06             #: largest change of lengths, as a logarithm
TILT = 0.15             #: largest relative rise of the pressure over the contact's reach
NOISE = (0.005, 0.03)   #: standard deviation [contact's level]
DEAD = 0.04             #: largest fraction of taxels without a value
AROUND = 2              #: taxels around a contact that belong to its frame
MARGIN = 5              #: taxels beside a contact: the rest of the pad, by which its noise is known


class Examples(NamedTuple):
    """Patches of one shape, K of them."""

    patches: list[Patch]
    touch: np.ndarray        #: (K,), number of the touch
    is_recorded: np.ndarray  #: (K,), bool: the middle frame of a touch as it was recorded, by which a head is judged

    @property
    def touches(self) -> int:
        return int(self.touch.max(initial=-1)) + 1


def examples_of(touches: Sequence[Touch], rng: np.random.Generator) -> Examples:
    """Return the patches of each touch: those of its frames, and VARIANTS more."""
    patches: list[Patch] = []
    numbers: list[int] = []
    recorded: list[bool] = []
    for number, touch in enumerate(touches):
        own = [make_patch(frame.values, frame.mask) for frame in (touch.middle, *touch.frames)]
        for k in range(VARIANTS):
            variant = _variant(touch.frames[k % len(touch.frames)], rng)
            own += [] if variant is None else [variant]
        patches += own
        numbers += [number] * len(own)
        recorded += [True] + [False] * (len(own) - 1)
    return Examples(patches, np.array(numbers), np.array(recorded))


def _variant(frame: TouchFrame, rng: np.random.Generator) -> Patch | None:
    """The contact of ``frame`` rotated and moved by any part of a taxel; None where it is not found again."""
    on_off = are_on_off(frame.values)
    places = np.argwhere(frame.mask)
    centre = places.mean(0)
    reach = np.hypot(*(places - centre).T).max() + 1
    side = int(np.ceil(2 * reach)) + 2 * MARGIN
    angle, size = rng.uniform(0, 2 * np.pi), np.exp(rng.uniform(-SIZE, SIZE))
    at = np.indices((side, side), float) - (np.array([side - 1, side - 1]) / 2 + rng.uniform(-0.5, 0.5, 2))[
        :, None, None]
    turn = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle)))) / size
    order = 1 if on_off else 3
    values = ndimage.map_coordinates(_contact_alone(frame), np.tensordot(turn, at, 1) + centre[:, None, None],
                                     order=order)
    if on_off:
        return _patch(values >= 0.5 * np.nanmax(frame.values))
    along = rng.uniform(0, TILT) / reach
    towards = rng.uniform(0, 2 * np.pi)
    values *= 1 + along * (np.cos(towards) * at[1] + np.sin(towards) * at[0])
    known = frame.values[frame.mask & np.isfinite(frame.values)]
    values += float(np.median(known)) * rng.uniform(*NOISE) * rng.standard_normal(values.shape)
    values[rng.random(values.shape) < rng.uniform(0, DEAD)] = np.nan
    return _patch(values)


def _contact_alone(frame: TouchFrame) -> np.ndarray:
    """The values of contact and surroundings, taxels without one as the nearest that has one; 0 elsewhere."""
    values = frame.values
    hidden = ~np.isfinite(values)
    if hidden.any():
        nearest = ndimage.distance_transform_edt(hidden, return_distances=False, return_indices=True)
        values = values[tuple(nearest)]
    near = ndimage.binary_dilation(frame.mask, np.ones((3, 3)), AROUND)
    return np.where(near, values, 0.0)


def _patch(values: np.ndarray) -> Patch | None:
    pattern = PatternExtractor().extract(values)
    return make_patch(pattern.values, joined(pattern)) if pattern.mask.any() else None
