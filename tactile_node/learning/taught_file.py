"""Write the file of taught shapes, from the examples of each shape.

The file contains the unchanged arrays of the base, and the heads.

The file is an .npz file without pickled objects. `ShapeRecogniser.from_file` loads the file instead of the base.
"""

from collections.abc import Mapping, Sequence
from typing import BinaryIO, NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import grown
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import are_on_off
from tactile_node.errors import ConfigurationError
from tactile_node.learning.touches import Touch, TouchFrame
from tactile_node.shape.patch import Patch, joined, make_patch
from tactile_node.shape.taught import HEAD_PARTS, HEAD_VERSION, MOST_TAUGHT, Head, digest_of, is_name, is_own

TOUCH_VARIANTS = 16  #: Number of variants of each touch.
SIZE_CHANGE = 0.06  #: Largest change of lengths in a variant, as a logarithm.
MOST_TILT = 0.15  #: Largest relative rise of the pressure from the centre to the end of the contact in a variant.
NOISE_RANGE = (0.005, 0.03)  #: Range of the noise's standard deviation, as a share of the contact's level.
MOST_DEAD = 0.04  #: Largest share of taxels without a value in a variant.
REST_MARGIN = 5  #: Width of the unpressed margin around a contact, which shows the noise of the pad [taxels].


class Examples(NamedTuple):
    """K patches of one shape."""

    patches: list[Patch]
    touch: np.ndarray  #: (K,), number of the touch from which each patch comes

    #: bool (K,), True for the recorded middle frame of each touch. A head is judged by these frames.
    is_recorded: np.ndarray

    @property
    def touches(self) -> int:
        return int(self.touch.max(initial=-1)) + 1


def examples_of(touches: Sequence[Touch], rng: np.random.Generator) -> Examples:
    """Return the patches of each touch: the patches of its frames, and TOUCH_VARIANTS variants."""
    patches: list[Patch] = []
    numbers: list[int] = []
    recorded: list[bool] = []
    for number, touch in enumerate(touches):
        own = [make_patch(frame.values, frame.mask) for frame in (touch.middle, *touch.frames)]
        for k in range(TOUCH_VARIANTS):
            variant = _variant(touch.frames[k % len(touch.frames)], rng)
            own += [] if variant is None else [variant]
        patches += own
        numbers += [number] * len(own)
        recorded += [True] + [False] * (len(own) - 1)
    return Examples(patches, np.array(numbers), np.array(recorded))


def _variant(frame: TouchFrame, rng: np.random.Generator) -> Patch | None:
    """Return the contact of ``frame``, rotated and shifted by a fraction of a taxel, or None if no contact is left."""
    on_off = are_on_off(frame.values)
    places = np.argwhere(frame.mask)
    centre = places.mean(0)
    reach = np.hypot(*(places - centre).T).max() + 1
    side = int(np.ceil(2 * reach)) + 2 * REST_MARGIN
    angle, size = rng.uniform(0, 2 * np.pi), np.exp(rng.uniform(-SIZE_CHANGE, SIZE_CHANGE))
    at = np.indices((side, side), float) - (np.array([side - 1, side - 1]) / 2 + rng.uniform(-0.5, 0.5, 2))[
        :, None, None]
    turn = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle)))) / size
    order = 1 if on_off else 3
    values = ndimage.map_coordinates(_contact_alone(frame), np.tensordot(turn, at, 1) + centre[:, None, None],
                                     order=order)
    if on_off:
        return _patch(values >= 0.5 * np.nanmax(frame.values))
    along = rng.uniform(0, MOST_TILT) / reach
    towards = rng.uniform(0, 2 * np.pi)
    values *= 1 + along * (np.cos(towards) * at[1] + np.sin(towards) * at[0])
    known = frame.values[frame.mask & np.isfinite(frame.values)]
    values += float(np.median(known)) * rng.uniform(*NOISE_RANGE) * rng.standard_normal(values.shape)
    values[rng.random(values.shape) < rng.uniform(0, MOST_DEAD)] = np.nan
    return _patch(values)


def _contact_alone(frame: TouchFrame) -> np.ndarray:
    """Return the values of the contact and of two taxels around it, and 0 elsewhere.

    A taxel without a value gets the value of the nearest taxel with a value.
    """
    values = frame.values
    hidden = ~np.isfinite(values)
    if hidden.any():
        nearest = ndimage.distance_transform_edt(hidden, return_distances=False, return_indices=True)
        values = values[tuple(nearest)]
    return np.where(grown(grown(frame.mask)), values, 0.0)


def _patch(values: np.ndarray) -> Patch | None:
    pattern = PatternExtractor().extract(values)
    return make_patch(pattern.values, joined(pattern)) if pattern.mask.any() else None


NO_EXAMPLES = Examples([], np.zeros(0, int), np.zeros(0, bool))


def check_name(name: str, known: Sequence[str] = ()) -> None:
    """Raise ConfigurationError if ``name`` cannot be the name of a new taught shape, given the ``known`` names."""
    if not is_name(name):
        raise ConfigurationError('--name', expected='a lower-case name such as my_plug, not the name of a class',
                                 got=repr(name), remedy='Use at most 32 of the characters a-z, 0-9 and _.')
    if name in known:
        raise ConfigurationError('--name', expected='a name that has not been taught yet', got=repr(name),
                                 remedy='Give each shape its own name.')
    if len(known) >= MOST_TAUGHT:
        raise ConfigurationError('--name', expected=f'at most {MOST_TAUGHT} taught shapes', got='one more',
                                 remedy='Teach fewer shapes.')


def write_taught(stream: BinaryIO, base: Mapping[str, np.ndarray], names: Sequence[str],
                 heads: Mapping[str, Head]) -> None:
    """Write the file of taught shapes.

    Parameters
    ----------
    stream : BinaryIO
        File to write to.
    base : mapping of str to np.ndarray
        Arrays of the file that teaching started from.
    names : sequence of str
        Names of the taught shapes.
    heads : mapping of str to Head
        Head for each kind of frame.
    """
    arrays = {name: array for name, array in base.items() if not is_own(name)}
    arrays |= {'taught_version': np.array(HEAD_VERSION), 'taught_names': np.array(names),
               'taught_base': np.array(digest_of(arrays))}
    for kind, head in heads.items():
        arrays |= {f'{kind}_taught_{part}': array for part, array in zip(HEAD_PARTS, head)}
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
