"""Convert a bag with the topics of a skin to a recording of Rerun, with pads, outlines, forces and the grasp.

    pip install rerun-sdk==0.41.0 '.[bag]'     # in an environment of its own; LeRobot needs an older Rerun
    python examples/rerun_bag.py BAG skin.rrd
    rerun skin.rrd

Grey taxels have no valid value, and green taxels are saturated. An outline disappears as soon as a frame has no fit.
An unknown number is NaN, which Rerun shows as a gap.
"""

import sys
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from tactile_node.colour_map import RGB_TABLE, ColourScale
from tactile_node.logs.topic_bag import TopicBagReader, frame_of, pad_of, seconds
from tactile_node.taxel_frame import TaxelStatus

NUMBERS = ('width', 'offset', 'grip_force')  #: fields of Grasp [m, m, N]
OUTLINE = (0, 255, 255)


class Pad:
    """Logs the frames and outlines of one pad."""

    def __init__(self, name: str):
        self._name = name
        self._scale = ColourScale()
        self._pitch = np.nan

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
        rr.log(f'{self._name}/force', rr.Scalars(message.force))


def main(bag: str, output: str) -> None:
    reader = TopicBagReader(bag)
    pads = {name: Pad(name) for name in reader.pads}
    rr.init('tactile_skin')
    rr.save(output, default_blueprint=rrb.Vertical(
        rrb.Horizontal(*(rrb.Spatial2DView(origin=f'{name}/taxels', name=name) for name in pads)),
        rrb.TimeSeriesView(contents=[*(f'/{name}/force' for name in pads), '/grasp/grip_force'], name='force [N]'),
        rrb.TextLogView(origin='grasp/state', name='grasp')))
    state = ''
    for message in reader.messages([f'tactile_skin/msg/{name}' for name in ('TaxelArray', 'ContactShape', 'Grasp')]):
        content, kind = message.content, message.type.rpartition('/')[2]
        rr.set_time('acquired', timestamp=seconds(content.header.stamp))
        if kind == 'TaxelArray':
            pads[pad_of(message.topic)].log_taxels(content)
        elif kind == 'ContactShape':
            pads[pad_of(message.topic)].log_shape(content)
        else:
            for name in NUMBERS:
                rr.log(f'grasp/{name}', rr.Scalars(getattr(content, name)))
            text = f'{content.message}: {content.class_name}'
            if text != state:
                rr.log('grasp/state', rr.TextLog(text))
            state = text
    for damage in reader.damages:
        print(f'rerun_bag: missing in the bag: {damage}', file=sys.stderr)


if __name__ == '__main__':
    main(*sys.argv[1:3])
