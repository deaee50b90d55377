"""Read the taxel frames of a bag of topics without ROS, for `tactile replay`."""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from tactile_node.cli.progress import count_progress
from tactile_node.errors import LogError
from tactile_node.interruption import interruption
from tactile_node.logs.damage import damage_lines
from tactile_node.taxel_frame import TaxelFrame
from tactile_node.viewing.recordings import BagRecording, Sink


class RecordedPad(NamedTuple):
    """Taxel frames of one pad, in chronological order."""

    shape: tuple[int, int]      #: number of rows and columns
    pitch: float                #: distance between neighbouring taxels [m]
    unit: str                   #: unit of the values
    frames: list[TaxelFrame]

    @property
    def summary(self) -> str:
        """Text that counts the taxel frames, the incomplete ones and the lost acquisitions."""
        steps = np.diff([frame.sequence for frame in self.frames])
        incomplete = sum(frame.missing_can_frames > 0 for frame in self.frames)
        return (f'{len(self.frames)} taxel frames, {len(self.frames) - incomplete} complete, {incomplete} incomplete; '
                f'{int((steps[steps > 0] - 1).sum())} acquisitions missing between them')


class FrameList(Sink):
    """A sink for `BagRecording` that keeps the taxel frames in memory, and counts them on a progress bar."""

    def __init__(self, bar: tqdm):
        self.pads: dict[str, RecordedPad] = {}  #: taxel frames by pad name
        self._bar = bar

    def add(self, pad: str, frame: TaxelFrame, pitch: float, unit: str) -> bool:
        rows, cols = frame.values.shape
        found = self.pads.setdefault(pad, RecordedPad((rows, cols), pitch, unit, []))
        if found[:3] != ((rows, cols), pitch, unit):
            return False
        found.frames.append(frame)
        self._bar.update()
        return True


def read_bag(recording: BagRecording) -> dict[str, RecordedPad]:
    """Return the taxel frames of each pad, and report unreadable parts on stderr.

    Raises
    ------
    LogError
        Raised if a pad has no taxel frame in the bag.
    KeyboardInterrupt
        Raised if the user interrupts the command.
    """
    with interruption() as stop_requested, count_progress(Path(recording.title).name, ' frames') as bar:
        found = FrameList(bar)
        recording.read(found, stop_requested)
        if stop_requested.is_set():
            raise KeyboardInterrupt
    for line in damage_lines(recording.damages):
        print(line, file=sys.stderr)
    if recording.unread:
        print(f'{recording.title}: {recording.unread} parts were not read, the last because of: {recording.problem}.',
              file=sys.stderr)
    if missing := [pad for pad in recording.pads if pad not in found.pads]:
        raise LogError(recording.title, expected='taxel frames of each pad', got=f'none of {", ".join(missing)}',
                       remedy='Name the other pads with --pads, or read another part of the bag.')
    return {pad: found.pads[pad] for pad in recording.pads}
