"""The file of taught shapes: the base's arrays as they are, the heads, and the examples, so that more can be taught.

It is one .npz without pickled objects that `ShapeRecogniser.from_file` loads in place of the base.
"""

from collections.abc import Mapping, Sequence
from typing import BinaryIO

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.shape.patch import HIGHEST_LEVEL, SIDE, Patch
from tactile_node.shape.taught import MOST_TAUGHT, PARTS, VERSION, Head, digest_of, is_name, is_own
from tactile_node.teaching.examples import Examples

LEVEL_STEPS = 255 / HIGHEST_LEVEL  #: levels are kept as whole numbers of this fraction, as in training
NO_EXAMPLES = Examples([], np.zeros(0, int), np.zeros(0, bool))


def check_name(name: str, known: Sequence[str] = ()) -> None:
    """Raise ConfigurationError for what cannot name one more taught shape beside those ``known``."""
    if not is_name(name):
        raise ConfigurationError('--name', expected='a lower-case name such as my_plug, none of the classes',
                                 got=repr(name), remedy='Use a-z, 0-9 and _, up to 32 of them.')
    if name in known:
        raise ConfigurationError('--name', expected='a name that is not taught yet', got=repr(name),
                                 remedy='Give another name, or start from a --model without it.')
    if len(known) >= MOST_TAUGHT:
        raise ConfigurationError('--name', expected=f'at most {MOST_TAUGHT} taught shapes', got='one more',
                                 remedy='Start from a --model with fewer.')


def write_taught(stream: BinaryIO, base: Mapping[str, np.ndarray], names: Sequence[str], heads: Mapping[str, Head],
                 examples: Mapping[str, Sequence[Examples]]) -> None:
    """Write the file. ``base``: arrays of the file that was taught on; ``heads``, ``examples``: by kind of frames."""
    arrays = {name: array for name, array in base.items() if not is_own(name)}
    arrays |= {'taught_version': np.array(VERSION), 'taught_names': np.array(names),
               'taught_base': np.array(digest_of(arrays))}
    for kind, head in heads.items():
        arrays |= {f'{kind}_taught_{part}': array for part, array in zip(PARTS, head)}
        arrays |= {f'{kind}_touch_{name}': array for name, array in _packed(examples[kind]).items()}
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]


def examples_in(data: Mapping[str, np.ndarray], kind: str, shapes: int) -> list[Examples]:
    """Return the examples of each of ``shapes`` taught shapes in the arrays of a file that has been loaded.

    Raises ConfigurationError where they are none.
    """
    has_head = f'{kind}_taught_{PARTS[0]}' in data
    if f'{kind}_touch_levels' not in data and not has_head:
        return [NO_EXAMPLES] * shapes
    try:  # a head without its examples could not be fitted again: its shapes would be lost
        return _unpacked(data, kind, shapes)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise ConfigurationError('examples of taught shapes', expected='those that `tactile teach` writes',
                                 got=' '.join(str(error).split()), remedy='Start from another --model.') from None


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
    cells = np.unpackbits(unseen, axis=1)[:, :SIDE * SIDE].reshape(count, SIDE, SIDE).astype(np.float32)
    patches = [Patch(level / np.float32(LEVEL_STEPS), cell, float(scale), graded=kind == 'graded')
               for level, cell, scale in zip(levels, cells, scales)]
    return [Examples([patches[k] for k in np.flatnonzero(shape == each)], number[shape == each].astype(int),
                     recorded[shape == each].astype(bool)) for each in range(shapes)]
