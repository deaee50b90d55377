"""Read the touches for `tactile teach` and `tactile assess` from .npz and .npy files, CAN logs, or a live bus."""

import argparse
import sys
from collections import Counter
from pathlib import Path
from queue import Empty, SimpleQueue

import numpy as np

from tactile_node.assembly.health import Failure
from tactile_node.bus.skin_bus import SkinBus
from tactile_node.cli.frame_file import read_frames
from tactile_node.cli.options import bus_settings_of, eds_of, pads_of, single_pad_of
from tactile_node.cli.played_log import play_log
from tactile_node.errors import BusError
from tactile_node.interruption import interruption
from tactile_node.learning.presses import subtract_zero
from tactile_node.learning.touches import Touch, Touches, TouchFinder
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.pads import with_dictionaries
from tactile_node.taxel_frame import ON_OFF_UNIT

ARRAY_SUFFIXES = ('.npy', '.npz')
REST_FRAMES = 25      #: number of frames used to determine the zero of a live skin
STEADY_FRAMES = 10    #: number of frames for which an object must stay still before the touch counts
FRAME_TIMEOUT = 10.0  #: time without a frame after which a live recording fails [s]
WHAT_TO_DO = ('Touch the skin {count} times with this object: {name}. Hold the object still until the touch counts. '
              'Then lift it, rotate it, and touch at another place. Keep away from the edges of the pad.')


class OfLastName(argparse.Action):
    """Collects the files of each --from in ``sources``, under the preceding --name."""

    def __call__(self, parser, namespace, values, option_string=None):
        if not namespace.name:
            parser.error('--from: give the name first, as in --name NAME --from FILE')
        namespace.sources.setdefault(namespace.name[-1], []).extend(values)


def touches_of(name: str, args: argparse.Namespace, finder_type: type[TouchFinder] = TouchFinder) -> Touches:
    """Return the touches of one object from its files, or live from the bus if it has no files.

    The function also prints the number of touches. Live touches are recorded in the folder of --output, or in the
    working folder. If a log of this name exists, they are recorded to a new file next to that log.

    Parameters
    ----------
    name : str
        Name of the object.
    args : argparse.Namespace
        Options of the command: --touches, --output, the skin and bus options, and ``sources`` from `OfLastName`.
    finder_type : type[TouchFinder]
        Finder that selects the touches to use.

    Raises
    ------
    KeyboardInterrupt
        Raised if the user stops a live recording.
    BusError
        Raised if the bus fails, or if no frame arrives for FRAME_TIMEOUT.
    """
    files = args.sources.get(name)
    if files:
        found = [_in_array(path, finder_type) if Path(path).suffix in ARRAY_SUFFIXES
                 else _in_log(path, finder_type, args) for path in files]
        for path, each in zip(files, found):
            if not each.touches:
                _say(f'{name}: {path}: {each}{"" if each.unused else ", because no frame has a contact"}')
        touches = _join(found)
    else:
        touches = _live_touches(name, args, finder_type)
    print(f'{name}: {touches}')
    return touches


def _join(found: list[Touches]) -> Touches:
    unused: Counter = Counter()
    for each in found:
        unused.update(each.unused)
    return Touches([touch for each in found for touch in each.touches], unused)


def _in_array(path: str, finder_type: type[TouchFinder]) -> Touches:
    frames = read_frames(path)
    values = frames.values if frames.unit in (None, ON_OFF_UNIT) else subtract_zero(frames.values)
    return finder_type(frames.unit).find(values)


def _in_log(path: str, finder_type: type[TouchFinder], args: argparse.Namespace) -> Touches:
    pads = pads_of(args)
    played = play_log(path, pads, channel=args.channel or '', any_device=args.any_device, must_be_used=True)
    found = []
    for pad in pads:
        frames = np.array([frame.values for frame in played.frames[pad.name]])
        unit = pad.layout.value.unit
        found.append(finder_type(unit).find(frames if unit == ON_OFF_UNIT else subtract_zero(frames)))
    return _join(found)


def _live_touches(name: str, args: argparse.Namespace, finder_type: type[TouchFinder]) -> Touches:
    """Guide the user through the touches, and record the bus. Print the path of the log even after an error."""
    record = (Path(args.output).parent if args.output else Path()) / f'{name}_touches.log'
    pad = single_pad_of(args, 'Touch one pad; the result is also valid for the other pad.')
    frames: SimpleQueue[np.ndarray] = SimpleQueue()
    failures: list[Failure] = []
    pads = with_dictionaries((pad,), eds_of(args))
    bus = SkinBus(bus_settings_of(args, str(record)), pads, lambda _, frame: frames.put(frame.values),
                  on_failure=failures.append)
    try:
        bus.open()
        bus.configure()
        bus.start()
        return _guide(name, args.touches, pad.layout, frames, failures, finder_type)
    finally:
        recorded = bus.recorded_to
        bus.close()
        if recorded is not None:
            _say(f'The bus was recorded to {recorded}. To use these touches again, give --from {recorded}.')


def _guide(name: str, count: int, layout: SkinLayout, frames: SimpleQueue, failures: list[Failure],
           finder_type: type[TouchFinder] = TouchFinder) -> Touches:
    finder, zero = finder_type(layout.value.unit), np.zeros((layout.rows, layout.cols))
    touches: list[Touch] = []
    was_steady, last = False, None
    with interruption() as stop_requested:
        if layout.value.unit != ON_OFF_UNIT:
            _say('Leave the skin untouched ...')
            rest = [_next(frames, failures, stop_requested) for _ in range(REST_FRAMES)]
            zero = np.nan_to_num(np.nanmedian(rest, axis=0))
        _say(WHAT_TO_DO.format(name=name, count=count))
        while len(touches) < count:
            ended = finder.feed(_next(frames, failures, stop_requested) - zero)
            if ended:
                touches += ended if was_steady else []
                _say(f'touch {len(touches)} of {count}' if was_steady
                     else 'That touch was too short. Hold the object still.')
                was_steady = False
            elif finder.is_steady(STEADY_FRAMES) and not was_steady:
                was_steady = True
                _say('  steady: lift the object and rotate it')
            elif finder.reason is not None and finder.reason is not last:
                _say(f'  not used: {finder.reason.name.lower().replace("_", " ")}')
            last = finder.reason
    return Touches(touches[:count], finder.unused)


def _next(frames: SimpleQueue, failures: list[Failure], stop_requested) -> np.ndarray:
    waited = 0.0
    while True:
        if stop_requested.is_set():
            raise KeyboardInterrupt
        if failures:
            raise BusError('CAN bus', expected='a working bus', got=str(failures[0]).rstrip('.'),
                           remedy='Correct the fault, then start the command again.')
        try:
            return frames.get(timeout=0.1)
        except Empty:
            waited += 0.1
        if waited > FRAME_TIMEOUT:
            raise BusError('CAN bus', expected='taxel frames', got=f'none for {FRAME_TIMEOUT:.0f} s',
                           remedy='Check the device with `tactile scan`.')


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
