"""Read and write the file of taught shapes.

The file contains the unchanged arrays of the base, the heads, and the examples needed to teach more shapes.

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
from tactile_node.learning.head_fit import unpack_patches
from tactile_node.learning.touches import Touch, TouchFrame
from tactile_node.shape.patch import HIGHEST_LEVEL, SIDE, Patch, joined, make_patch
from tactile_node.shape.steepest_outline import steepest_outline
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
        own = [_patch_of(frame.values, frame.mask) for frame in (touch.middle, *touch.frames)]
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
        return _found_patch(values >= 0.5 * np.nanmax(frame.values))
    along = rng.uniform(0, MOST_TILT) / reach
    towards = rng.uniform(0, 2 * np.pi)
    values *= 1 + along * (np.cos(towards) * at[1] + np.sin(towards) * at[0])
    known = frame.values[frame.mask & np.isfinite(frame.values)]
    values += float(np.median(known)) * rng.uniform(*NOISE_RANGE) * rng.standard_normal(values.shape)
    values[rng.random(values.shape) < rng.uniform(0, MOST_DEAD)] = np.nan
    return _found_patch(values)


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


def _found_patch(values: np.ndarray) -> Patch | None:
    pattern = PatternExtractor().extract(values)
    return _patch_of(pattern.values, joined(pattern)) if pattern.mask.any() else None


def _patch_of(values: np.ndarray, mask: np.ndarray) -> Patch:
    return make_patch(values, steepest_outline(values, mask))


LEVEL_STEPS = 255 / HIGHEST_LEVEL  #: Levels are stored as whole multiples of 1 / LEVEL_STEPS, as in training.
NO_EXAMPLES = Examples([], np.zeros(0, int), np.zeros(0, bool))


def check_name(name: str, known: Sequence[str] = ()) -> None:
    """Raise ConfigurationError if ``name`` cannot be the name of a new taught shape, given the ``known`` names."""
    if not is_name(name):
        raise ConfigurationError('--name', expected='a lower-case name such as my_plug, not the name of a class',
                                 got=repr(name), remedy='Use at most 32 of the characters a-z, 0-9 and _.')
    if name in known:
        raise ConfigurationError('--name', expected='a name that has not been taught yet', got=repr(name),
                                 remedy='Choose another name, or start from a --model file without this name.')
    if len(known) >= MOST_TAUGHT:
        raise ConfigurationError('--name', expected=f'at most {MOST_TAUGHT} taught shapes', got='one more',
                                 remedy='Start from a --model file with fewer taught shapes.')


def write_taught(stream: BinaryIO, base: Mapping[str, np.ndarray], names: Sequence[str], heads: Mapping[str, Head],
                 examples: Mapping[str, Sequence[Examples]]) -> None:
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
    examples : mapping of str to sequence of Examples
        Examples of each shape for each kind of frame.
    """
    arrays = {name: array for name, array in base.items() if not is_own(name)}
    arrays |= {'taught_version': np.array(HEAD_VERSION), 'taught_names': np.array(names),
               'taught_base': np.array(digest_of(arrays))}
    for kind, head in heads.items():
        arrays |= {f'{kind}_taught_{part}': array for part, array in zip(HEAD_PARTS, head)}
        arrays |= {f'{kind}_touch_{name}': array for name, array in _packed(examples[kind]).items()}
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]


def examples_in(data: Mapping[str, np.ndarray], kind: str, shapes: int) -> list[Examples]:
    """Return the examples of each taught shape from the arrays of a file.

    Parameters
    ----------
    data : mapping of str to np.ndarray
        Arrays of the file.
    kind : str
        'graded' or 'on_off'.
    shapes : int
        Number of taught shapes.

    Raises
    ------
    ConfigurationError
        Raised if the arrays do not come from a file of taught shapes.
    """
    has_head = f'{kind}_taught_{HEAD_PARTS[0]}' in data
    if f'{kind}_touch_levels' not in data and not has_head:
        return [NO_EXAMPLES] * shapes
    try:  # a head without its examples could not be fitted again, and its shapes would be lost
        return _unpacked(data, kind, shapes)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise ConfigurationError('examples of taught shapes', expected='the examples that `tactile teach` writes',
                                 got=' '.join(str(error).split()), remedy='Start from another --model file.') from None


def _packed(shapes: Sequence[Examples]) -> dict[str, np.ndarray]:
    patches = [patch for each in shapes for patch in each.patches]
    levels = np.clip(np.stack([patch.level for patch in patches]) * LEVEL_STEPS + 0.5, 0, 255).astype(np.uint8)
    return {'levels': levels,
            'unseen': np.packbits(np.stack([patch.unseen.reshape(-1) > 0.5 for patch in patches]), axis=1),
            'scales': np.array([patch.scale for patch in patches], np.float32),
            'shape': np.repeat(np.arange(len(shapes)), [len(each.patches) for each in shapes]).astype(np.uint8),
            'number': np.concatenate([each.touch for each in shapes]).astype(np.int32),
            'recorded': np.concatenate([each.is_recorded for each in shapes])}


def _unpacked(data: Mapping[str, np.ndarray], kind: str, shapes: int) -> list[Examples]:
    levels, unseen, scales, shape, number, recorded = (
        data[f'{kind}_touch_{name}'] for name in ('levels', 'unseen', 'scales', 'shape', 'number', 'recorded'))
    count = len(levels)
    if levels.shape != (count, SIDE, SIDE) or levels.dtype != np.uint8 or not (scales >= 1).all() or not all(
            array.shape == (count,) for array in (scales, shape, number, recorded)):
        raise ValueError(f'arrays of {kind} that do not fit together')
    patches = unpack_patches(levels / np.float32(LEVEL_STEPS), unseen, scales, kind)
    return [Examples([patches[k] for k in np.flatnonzero(shape == each)], number[shape == each].astype(int),
                     recorded[shape == each].astype(bool)) for each in range(shapes)]
