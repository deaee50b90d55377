"""`tactile teach` teaches the recogniser your own shapes in a few minutes, from about 30 touches of each shape.

    tactile teach --name plug --output my_shapes.npz                     # live, guides you through 30 touches
    tactile teach --name plug --from touches.log --output my_shapes.npz  # from recordings, also .npz and .npy

The output file contains the networks of --model and your shapes. Pass the file to the classifier node (model:=), to
`tactile classify` (--model) or to the library (Recogniser(file=...)). On the ROS topics, a taught shape has the code
OTHER and its own name.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tactile_node.cli.figure_file import check_figure, write_figure
from tactile_node.cli.options import (
    add_any_device_option,
    add_bus_options,
    add_number,
    add_output_option,
    add_skin_options,
)
from tactile_node.cli.progress import count_progress
from tactile_node.cli.touch_sources import OfLastName, touches_of
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.learning.background import load_background
from tactile_node.learning.taught_file import NO_EXAMPLES, Examples, check_name, examples_of, write_taught
from tactile_node.learning.teach import (
    LEAST_RIGHT,
    LEAST_TOUCHES,
    MOST_LOST,
    STAGES,
    HeldOut,
    Taught,
    confusion_picture,
    teach,
)
from tactile_node.output_file import check_writable, output_file
from tactile_node.package_files import config_path
from tactile_node.shape.adaptation import is_of_skin
from tactile_node.shape.recogniser import KINDS, ShapeRecogniser, read_arrays
from tactile_node.shape.recognition import LEARNED, METHOD_FILES, TaughtShape

DEFAULT_TOUCHES = 30
VARIANT_SEED = 0  #: seed of the random variants of the touches
REFUSED_CODE = 1  #: exit code if recognition of the taught shapes is too poor to write the file


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--name', action='append', required=True, help='name of the shape; repeat --name for each '
                        'further shape in the file, followed by its --from')
    parser.add_argument('--from', nargs='+', action=OfLastName, dest='from_', metavar='FILE',
                        help='files with touches of the shape named before: CAN logs, or .npz and .npy files with '
                        'frames in chronological order (docs/command_line.md). Lift the object between two touches. '
                        'Without --from, the command records the touches live from the bus')
    add_output_option(parser, required=True, metavar='FILE', help='.npz file to write')
    parser.add_argument('--model', default=METHOD_FILES[LEARNED], metavar='FILE',
                        help='model without taught shapes, to which the command adds the shapes (default: '
                        'config/%(default)s)')
    add_number(parser, '--touches', int,
               limits={'least': LEAST_TOUCHES, 'remedy': f'{DEFAULT_TOUCHES} is a good number.'},
               default=DEFAULT_TOUCHES, metavar='N',
               help='number of touches of each shape in a live recording (default: %(default)s)')
    parser.add_argument('--picture', metavar='FILE', help='file for a picture that shows the answers to held-out '
                        'contacts of each shape')
    parser.add_argument('--accept-poor', action='store_true', help='write the file even if the recognition of held-out '
                        'contacts is poor')
    add_skin_options(parser)
    add_bus_options(parser, is_set=False)
    add_any_device_option(parser)
    parser.set_defaults(sources={})


def run(args: argparse.Namespace) -> int:
    """Teach the shapes and write --output.

    Returns 0, or REFUSED_CODE if recognition of a shape is too poor and --accept-poor is not given.
    """
    model = config_path(args.model)
    recogniser, base = ShapeRecogniser.from_file(model), read_arrays(model)
    if taught_before := [shape.value for shape in recogniser.classes if isinstance(shape, TaughtShape)]:
        raise ConfigurationError('--model', expected='a model without taught shapes', got=', '.join(taught_before),
                                 remedy='Teach all shapes of a file in one run, with --name and --from for each.')
    names: list[str] = []
    for name in args.name:
        check_name(name, names)
        names.append(name)
    if any(map(is_of_skin, base)):
        print('tactile: the new file will not contain the adaptation of --model to a skin. Assess the new file '
              '(tactile assess).', file=sys.stderr)
    if args.picture:
        check_figure(args.picture)
    inputs = [model, *sum(args.sources.values(), [])]
    for path in (args.output, *_pictures(args.picture)):
        check_writable(path, inputs, force=args.force)
    examples: dict[str, list[Examples]] = {kind: [] for kind in KINDS}
    for name in names:
        kind, found = _record(name, args)
        for shapes in examples.values():
            shapes.append(found if shapes is examples[kind] else NO_EXAMPLES)
    taught = {kind: _taught(recogniser, kind, shapes) for kind, shapes in examples.items()
              if any(shape.touches for shape in shapes)}
    for kind, result in taught.items():
        print(_summary(result.held_out, names, kind))
        _draw(args.picture, result.held_out, names, kind if len(taught) > 1 else '')
    if not all(result.held_out.is_good for result in taught.values()) and not args.accept_poor:
        print(f'tactile: {args.output} was not written. At least {LEAST_RIGHT:.0%} of the touches of each shape must '
              f'be recognised, and the five shapes must not lose more than {MOST_LOST:.1%}. The shape may look too '
              'similar to another one at this size, or its touches may differ too much. Record more touches, or a '
              'larger contact. With --accept-poor, the command writes the file nevertheless.', file=sys.stderr)
        return REFUSED_CODE
    with output_file(args.output, inputs=inputs) as stream:
        write_taught(stream, base, names, {kind: result.head for kind, result in taught.items()})
    print(f'Written to {args.output}. Give this file to the classifier node (model:=) or to tactile classify '
          '(--model).')
    return 0


def _record(name: str, args: argparse.Namespace) -> tuple[str, Examples]:
    """Return the kind of frames ('on_off' or 'graded') and the examples of one shape."""
    touches = touches_of(name, args)
    if len(touches.touches) < LEAST_TOUCHES:
        raise InputError(f'touches of {name}', expected=f'{LEAST_TOUCHES} or more, typically {DEFAULT_TOUCHES}',
                         got=str(len(touches.touches)),
                         remedy='Record more touches, and lift the object between touches.')
    examples = examples_of(touches.touches, np.random.default_rng(VARIANT_SEED))
    graded = {patch.graded for patch in examples.patches}
    if len(graded) > 1:
        raise InputError(f'touches of {name}', expected='either pressures or on/off taxels', got='both',
                         remedy='Teach the shape from touches on one skin.')
    return KINDS[graded.pop()], examples


def _taught(recogniser: ShapeRecogniser, kind: str, shapes: Sequence[Examples]) -> Taught:
    background = load_background(kind)
    with count_progress('teaching', ' steps', STAGES) as bar:
        return teach(recogniser, background, shapes, progress=bar.update)


def _summary(held_out: HeldOut, names: Sequence[str], kind: str) -> str:
    before, after = held_out.five
    lines = [f'On held-out contacts, {kind} frames, with 95 % intervals:']
    lines += [f'  {name}: {rate} of {rate.total} touches recognised' for name, rate in zip(names, held_out.taught)
              if rate.total]
    lines += [f'  the five shapes: {before} before, {after} after, of {before.total}',
              '  foreign contacts called a shape: {} before, {} after, of {}'.format(
                  *held_out.foreign, held_out.foreign[0].total)]
    return '\n'.join(lines)


def _pictures(path: str | None) -> list[Path]:
    """Return the paths of all pictures that `_draw` may write."""
    return [Path(path), *(Path(path).with_stem(f'{Path(path).stem}_{kind}') for kind in KINDS)] if path else []


def _draw(path: str | None, held_out: HeldOut, names: Sequence[str], kind: str) -> None:
    if not path:
        return
    target = Path(path)
    if kind:
        target = target.with_stem(f'{target.stem}_{kind}')
    write_figure(target, confusion_picture(held_out, names))
