"""`tactile assess` reports how reliably shapes are recognised on your own skin, from about 8 touches of each object.

    tactile assess --name circle --name bar --name unknown --output my_skin.npz            # live, guides you
    tactile assess --name circle --from discs.log --name unknown --from keys.log mug.npy   # report from recordings

Name each object after one of the five shapes or a taught shape of --model, or use the name bar (a rectangle), ball (a
circle), or unknown for any other object. The command fits an adaptation of --model to your skin. If the adaptation
improves recognition of touches that were not used to fit it, the command writes the adapted model to --output. Pass the
adapted model to the classifier node (model:=), to `tactile classify` (--model) or to the library
(Recogniser(file=...)).
"""

import argparse
import sys
from collections.abc import Iterator, Sequence

import numpy as np

from tactile_node.cli.figure_file import check_figure, write_figure
from tactile_node.cli.options import (
    add_any_device_option,
    add_bus_options,
    add_number,
    add_output_option,
    add_skin_options,
)
from tactile_node.cli.touch_sources import OfLastName, touches_of
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.learning.assess import (
    LEAST_TOUCHES,
    UNKNOWN_TOUCHES,
    Answers,
    Assessment,
    LabelledTouch,
    assess,
    reliability_picture,
)
from tactile_node.learning.skin_measures import measure_skin
from tactile_node.learning.teach import Rate
from tactile_node.learning.touches import AnyTouchFinder, TouchFrame
from tactile_node.output_file import check_writable, output_file
from tactile_node.package_files import config_path
from tactile_node.shape.adaptation import arrays_of, is_of_skin
from tactile_node.shape.recogniser import ShapeRecogniser, read_arrays
from tactile_node.shape.recognition import LEARNED, METHOD_FILES, ShapeClass

DEFAULT_TOUCHES = 8
ALIASES = {'bar': 'rectangle', 'ball': 'circle'}  #: class for each name that is not itself a class of the recogniser
REFUSED_CODE = 1  #: exit code if --output is given, but the adaptation is not kept


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--name', action='append', required=True,
                        help='name of the object; repeat --name for each further object, followed by its --from')
    parser.add_argument('--from', nargs='+', action=OfLastName, dest='from_', metavar='FILE',
                        help='files with touches of the object named before: CAN logs, or .npz and .npy files with at '
                        'least one frame, in chronological order (docs/command_line.md). Lift the object between two '
                        'touches. Without --from, the command records the touches live from the bus')
    add_output_option(parser, metavar='FILE', help='.npz file to write if the adaptation helps (default: only report)')
    parser.add_argument('--model', default=METHOD_FILES[LEARNED], metavar='FILE',
                        help='model to assess, for example a file of `tactile teach` (default: config/%(default)s)')
    add_number(parser, '--touches', int, limits={'least': 1}, default=DEFAULT_TOUCHES, metavar='N',
               help='number of touches of each object in a live recording (default: %(default)s)')
    parser.add_argument('--picture', metavar='FILE', help='file for a picture that shows how often answers of similar '
                        'confidence are right')
    add_skin_options(parser)
    add_bus_options(parser, is_set=False)
    add_any_device_option(parser)
    parser.set_defaults(sources={})


def run(args: argparse.Namespace) -> int:
    """Print the report, and write --output if the adaptation is kept.

    Returns 0, or REFUSED_CODE if --output was given but not written.
    """
    model = config_path(args.model)
    recogniser, base = ShapeRecogniser.from_file(model), read_arrays(model)
    labels = {name: _class_of(name, recogniser.outputs) for name in args.name}
    if args.picture:
        check_figure(args.picture)
    inputs = [model, *sum(args.sources.values(), [])]
    for path in filter(None, (args.output, args.picture)):
        check_writable(path, inputs, force=args.force)
    touches = [(label, touch.middle) for name, label in labels.items()
               for touch in touches_of(name, args, AnyTouchFinder).touches]
    frames = [frame for _, frame in touches]
    _check(frames)
    found = assess(recogniser, [LabelledTouch(label, frame.pattern) for label, frame in touches])
    print('\n'.join(_report(found)))
    print(f'This skin: {measure_skin(frames)}.')
    if args.picture:
        write_figure(args.picture, reliability_picture(found))
    if not args.output:
        return 0
    if found.adaptation is None:
        print(f'tactile: {args.output} was not written. Use the model as it is.', file=sys.stderr)
        return REFUSED_CODE
    if not found.adaptation.makes_sure and any(adaptation.makes_sure for adaptation in recogniser.adaptations.values()):
        print(f'tactile: {args.output} was not written. {model} is adapted with unknown objects, and the new '
              'adaptation would replace this one. Press unknown objects as well, or assess the model without an '
              'adaptation.', file=sys.stderr)
        return REFUSED_CODE
    arrays = {name: array for name, array in base.items() if not is_of_skin(name)}
    arrays |= arrays_of(found.kind, found.adaptation)
    with output_file(args.output, inputs=inputs) as stream:
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
    print(f'Written to {args.output}. Give this file to the classifier node (model:=) or to tactile classify '
          '(--model).')
    return 0


def _class_of(name: str, outputs: Sequence[ShapeClass]) -> ShapeClass:
    by_name = {shape.value: shape for shape in outputs}
    found = by_name.get(name) or by_name.get(ALIASES.get(name, ''))
    if found is None:
        raise ConfigurationError('--name', expected=f'one of {", ".join((*by_name, *ALIASES))}', got=repr(name),
                                 remedy='Give any other object the name unknown. Or teach its shape first '
                                 '(`tactile teach`), and assess the taught file (--model).')
    return found


def _check(frames: Sequence[TouchFrame]) -> None:
    if not frames:
        raise InputError('touches', expected='one or more', got='none',
                         remedy='Press away from the edges of the pad, and lift the object between touches.')
    if len(shapes := {frame.mask.shape for frame in frames}) > 1:
        sizes = ' and '.join(f'{rows}x{cols}' for rows, cols in sorted(shapes))
        raise InputError('touches', expected='touches of one skin', got=f'frames of {sizes} taxels',
                         remedy='Assess each skin separately.')


def _report(found: Assessment) -> Iterator[str]:
    yield 'As the model is, with 95 % intervals:'
    yield from _table(found.before)
    if found.improvement is None or found.after is None:
        yield f'No adaptation was tried. It needs at least {LEAST_TOUCHES} touches.'
        return
    yield 'Adapted, each touch answered by an adaptation that was fitted without it:'
    yield from _table(found.after)
    kept = (f'kept, with temperature {found.adaptation.temperature:.2f}' if found.adaptation
            else 'not kept, because the improvement is too small or too uncertain')
    yield f'The adaptation improves the Brier score by {found.improvement}: {kept}.'
    if found.adaptation and not found.adaptation.makes_sure:
        yield (f'Fewer than {UNKNOWN_TOUCHES} touches show unknown objects, so it is not known how this skin shows '
               'objects of other shapes. They may get the names of the touched objects more often. Therefore the '
               'adaptation makes no further name sure. Press unknown objects as well.')


def _table(answers: Answers) -> Iterator[str]:
    yield f'  {"":<20}{"touches":>7}  {"right":<21}{"no name":>7}{"sure":>6}{"sure and wrong":>16}'
    for label in (*dict.fromkeys(answers.labels), None):
        of = answers.counts(label)
        yield (f'  {label.value if label else "all":<20}{of.total:>7}  {Rate(of.right, of.total)!s:<21}{of.no_name:>7}'
               f'{of.sure:>6}{of.sure_and_wrong:>16}')
    yield f'  Brier score {answers.scores().mean():.3f}'
