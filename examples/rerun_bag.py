"""Convert a bag with the topics of a skin to a recording of Rerun, with pads, outlines, forces and the grasp.

    pip install rerun-sdk==0.41.0 '.[bag]'     # in a separate environment; LeRobot needs an older Rerun
    python examples/rerun_bag.py BAG skin.rrd
    rerun skin.rrd

Grey taxels have no valid value, and green taxels are saturated. An outline disappears as soon as a frame has no fit.
An unknown number is NaN, which Rerun shows as a gap. Where messages are missing, the example inserts a NaN.
"""

import argparse
import sys
from collections import deque
from collections.abc import Sequence
from statistics import median
from typing import Any

import numpy as np

from tactile_node.colour_map import RGB_TABLE, ColourScale
from tactile_node.errors import TactileError
from tactile_node.logs.topic_bag import TopicBagReader, frame_of, pad_of, seconds
from tactile_node.output_file import check_writable
from tactile_node.taxel_frame import TaxelStatus

try:
    import rerun as rr
    import rerun.blueprint as rrb
except ModuleNotFoundError as error:
    sys.exit(f'rerun_bag: expected Rerun, got: {error}. Install Rerun in a separate environment, as docs/viewers.md '
             'shows, and run this example with the python of that environment.')

NUMBERS = ('width', 'offset', 'grip_force')  #: fields of Grasp [m, m, N]
OUTLINE = (0, 255, 255)
MOST_PERIODS = 2.0   #: time between two messages above which data is missing [periods]
KEPT_INTERVALS = 100  #: number of latest intervals from which the period is estimated


class Curves:
    """Logs numbers as curves, with a NaN wherever messages are missing.

    Messages are missing if a sequence number jumps, or if two stamps are further apart than MOST_PERIODS.
    """

    def __init__(self, *names: str):
        self._names = names
        self._stamp: float | None = None
        self._sequences = np.zeros(0)
        self._intervals: deque[float] = deque(maxlen=KEPT_INTERVALS)

    def log(self, stamp: float, sequences: Sequence[int], values: Sequence[float]) -> None:
        """Log one value for each curve, at the stamp [s] of a message.

        ``sequences`` contains the sequence numbers of the pads from which the values were computed.
        """
        numbers = np.array(sequences, np.int64)
        if self._stamp is not None and self._is_gap(stamp, numbers):
            rr.set_time('acquired', timestamp=(self._stamp + stamp) / 2)
            self._log_at_time([np.nan] * len(self._names))
            rr.set_time('acquired', timestamp=stamp)
        self._log_at_time(values)
        self._stamp, self._sequences = stamp, numbers

    def _is_gap(self, stamp: float, sequences: np.ndarray) -> bool:
        steps, interval = sequences - self._sequences, stamp - self._stamp
        is_late = bool(self._intervals) and interval > MOST_PERIODS * median(self._intervals)
        if interval > 0 and not is_late:
            self._intervals.append(interval)
        return is_late or bool(((steps < 0) | (steps > 1)).any())

    def _log_at_time(self, values: Sequence[float]) -> None:
        for name, value in zip(self._names, values):
            rr.log(name, rr.Scalars(value))


class Pad:
    """Logs the frames and outlines of one pad."""

    def __init__(self, name: str):
        self._name = name
        self._scale = ColourScale()
        self._pitch = np.nan
        self._force = Curves(f'{name}/force')

    def log_taxels(self, message: Any) -> None:
        frame, self._pitch = frame_of(message), message.pitch
        saturated = frame.status == TaxelStatus.SATURATED
        colours = self._scale.numbers(frame.values, saturated, message.unit, frame.stamp)
        rr.log(f'{self._name}/taxels', rr.Image(RGB_TABLE[colours]))

    def log_shape(self, message: Any) -> None:
        corners = np.array([(corner.x, corner.y) for corner in message.outline.points]) / self._pitch + 0.5  # [pixels]
        outlines = [np.vstack((corners, corners[:1]))] if np.isfinite(corners).all() and len(corners) else []
        rr.log(f'{self._name}/taxels/outline',
               rr.LineStrips2D(outlines, colors=OUTLINE, labels=[message.class_name] * len(outlines)))
        self._force.log(seconds(message.header.stamp), [message.sequence], [message.force])


def convert(bag: str, output: str) -> None:
    """Convert a bag. Raises LogError if the bag has no taxels."""
    reader = TopicBagReader(bag)
    pads = {name: Pad(name) for name in reader.pads}
    rr.init('tactile_skin')
    rr.save(output, default_blueprint=rrb.Vertical(
        rrb.Horizontal(*(rrb.Spatial2DView(origin=f'{name}/taxels', name=name) for name in pads)),
        rrb.TimeSeriesView(contents=[*(f'/{name}/force' for name in pads), '/grasp/grip_force'], name='force [N]'),
        rrb.TextLogView(origin='grasp/state', name='grasp')))
    state, numbers = '', Curves(*(f'grasp/{name}' for name in NUMBERS))
    for message in reader.messages([f'tactile_skin/msg/{name}' for name in ('TaxelArray', 'ContactShape', 'Grasp')]):
        content, kind = message.content, message.type.rpartition('/')[2]
        rr.set_time('acquired', timestamp=seconds(content.header.stamp))
        if kind == 'TaxelArray':
            pads[pad_of(message.topic)].log_taxels(content)
        elif kind == 'ContactShape':
            pads[pad_of(message.topic)].log_shape(content)
        else:
            numbers.log(seconds(content.header.stamp), content.sequences, [getattr(content, name) for name in NUMBERS])
            text = f'{content.message}: {content.class_name}'
            if text != state:
                rr.log('grasp/state', rr.TextLog(text))
            state = text
    for damage in reader.damages:
        print(f'rerun_bag: missing in the bag: {damage}', file=sys.stderr)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('bag', help='bag with the topics of a skin: .mcap, .db3 or its folder')
    parser.add_argument('output', help='recording of Rerun to write, .rrd')
    parser.add_argument('--force', action='store_true', help='replace an existing file')
    args = parser.parse_args()
    try:
        check_writable(args.output, force=args.force)
        convert(args.bag, args.output)
    except TactileError as error:
        print(f'rerun_bag: {error}', file=sys.stderr)
        return 2
    return 0


if __name__ == '__main__':
    sys.exit(main())
