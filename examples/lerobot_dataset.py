"""Convert a bag with the topics of a skin to a LeRobot v3 data set, load the data set again, and compare it.

    pip install lerobot==0.4.4 '.[bag]'     # in an environment of its own, because LeRobot requires exact versions
    python examples/lerobot_dataset.py BAG FOLDER [--fps 30] [--window 4] [--task TEXT]

The bag needs <pad>/taxels, and may contain grasp and <pad>/events. The data set has one episode. In each of its frames,
a pad has a window of the latest acquisitions, one for each SYNC period, the newest last:

- observation.PAD.taxels: values [unit of the skin], FILL where no valid value exists
- observation.PAD.valid: True where a value is valid. For a lost acquisition, the whole mask is False. The value of a
  saturated taxel is valid, but a lower bound.
- observation.PAD.stamp: acquisition stamps [ns], NO_STAMP for a lost acquisition
- observation.PAD.events: number of events since the previous frame of the data set, by code of ContactEvent
- observation.grasp, observation.grasp_valid, observation.grasp_codes: latest grasp (NUMBERS, CODES)

A policy has to read the mask. FILL lies far outside the range of any skin, so a policy that ignores the mask fails
visibly. The statistics of the data set use valid values only. For a value that was never valid, they are FILL with a
standard deviation of 1.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tactile_node.errors import TactileError
from tactile_node.pose.events import EventKind

FILL = -1e6            #: value under the mask
NO_STAMP = -1          #: stamp of a lost acquisition
SECOND = 10**9         #: [ns]
GRASP_AGE = SECOND // 10  #: time after which the latest grasp is no longer used [ns]
KINDS = tuple(kind.name.lower() for kind in EventKind)  #: names of the events, in the order of their codes
NUMBERS = ('width', 'offset', 'misalignment', 'centre_x', 'centre_y', 'yaw', 'grip_force')  #: fields of Grasp [SI]
CODES = ('contact', 'shape', 'fresh', 'stable')  #: fields of Grasp; 0 if there is no current grasp
QUANTILES = {'q01': 0.01, 'q10': 0.1, 'q50': 0.5, 'q90': 0.9, 'q99': 0.99}  #: as LeRobot names them


class Acquisitions(NamedTuple):
    """All acquisitions of one pad, in the order of their sequence numbers."""

    sequences: np.ndarray  #: (n,) int64
    stamps: np.ndarray     #: (n,) int64 [ns]
    values: np.ndarray     #: (n, rows, cols) float32; NaN where no valid value exists

    @property
    def period(self) -> int:
        """SYNC period [ns]."""
        return int((self.stamps[-1] - self.stamps[0]) // (self.sequences[-1] - self.sequences[0]))


class Window(NamedTuple):
    """The latest acquisitions of one pad, the newest last."""

    taxels: np.ndarray  #: (length, rows, cols) float32
    valid: np.ndarray   #: (length, rows, cols) bool
    stamp: np.ndarray   #: (length,) int64


def window(pad: Acquisitions, at: int, length: int) -> Window:
    """Return the ``length`` acquisitions that were due at the time ``at`` [ns], with a gap for each lost acquisition.

    An acquisition counts as lost if its sequence number is missing, or if the next acquisition is late by more than
    half a period.
    """
    grid = pad.values.shape[1:]
    found = Window(np.full((length, *grid), FILL, np.float32), np.zeros((length, *grid), bool),
                   np.full(length, NO_STAMP, np.int64))
    latest = int(np.searchsorted(pad.stamps, at, side='right')) - 1
    if latest < 0:
        return found
    late = max(0, (at - int(pad.stamps[latest]) - pad.period // 2) // pad.period)
    due = int(pad.sequences[latest]) + late
    for number in range(max(0, latest - length + 1), latest + 1):
        slot = length - 1 - (due - int(pad.sequences[number]))
        if slot >= 0:
            found.valid[slot] = ~np.isnan(pad.values[number])
            found.taxels[slot][found.valid[slot]] = pad.values[number][found.valid[slot]]
            found.stamp[slot] = pad.stamps[number]
    return found


def statistics(values: np.ndarray, valid: np.ndarray) -> dict[str, np.ndarray]:
    """Return the statistics of the valid values in LeRobot's form, over the frames of the data set.

    Parameters
    ----------
    values, valid
        Values and their mask, both (frames, ...).
    """
    known = valid.any(axis=0)
    masked = np.where(valid | ~known, values, np.nan).astype(np.float64)
    found = {'min': np.nanmin(masked, 0), 'max': np.nanmax(masked, 0), 'mean': np.nanmean(masked, 0),
             'std': np.where(known, np.nanstd(masked, 0), 1.0), 'count': np.array([len(values)])}
    return found | dict(zip(QUANTILES, np.nanquantile(masked, list(QUANTILES.values()), axis=0)))


class Recording(NamedTuple):
    """The contents of a bag that enter the data set. All times are on the clock of the taxel stamps [ns]."""

    pads: Mapping[str, Acquisitions]
    grasps: list[tuple[int, Any]]            #: time and message of each grasp
    events: list[tuple[int, str, int]]       #: time, pad and kind of each event


def read(bag: Path) -> Recording:
    """Read a bag. Raises a TactileError if it has no taxels, or if the driver was restarted during the recording."""
    from tactile_node.errors import LogError
    from tactile_node.logs.topic_bag import TopicBagReader, pad_of

    reader = TopicBagReader(bag)
    frames: dict[str, list[Any]] = {pad: [] for pad in reader.pads}
    grasps, events = [], []
    for message in reader.messages([f'tactile_skin/msg/{name}' for name in ('TaxelArray', 'Grasp', 'ContactEvent')]):
        content, time, pad = message.content, round(message.stamp * SECOND), pad_of(message.topic)
        match message.type.rpartition('/')[2]:
            case 'TaxelArray':
                frames[pad].append(content)
            case 'Grasp':
                grasps.append((time, content))
            case 'ContactEvent':
                events.append((time, pad, int(content.kind)))
    for each in reader.damages:
        print(f'lerobot_dataset: missing in the bag: {each}', file=sys.stderr)
    pads = {}
    for pad, found in frames.items():
        sequences = np.array([each.sequence for each in found], np.int64)
        if len(found) < 2 or (np.diff(sequences) <= 0).any():
            raise LogError(f'{bag}, pad {pad}', expected='rising sequence numbers of at least two acquisitions',
                           got=f'{len(found)} acquisitions, '
                           f'{np.count_nonzero(np.diff(sequences) <= 0)} of them out of order',
                           remedy='Record one run of the driver in one bag.')
        pads[pad] = Acquisitions(
            sequences, np.array([each.header.stamp.sec * SECOND + each.header.stamp.nanosec for each in found]),
            np.array([np.reshape(each.values, (each.rows, each.cols)) for each in found], np.float32))
    return Recording(pads, grasps, events)


def frames_of(recording: Recording, fps: int, length: int) -> Iterator[dict[str, np.ndarray]]:
    """Yield the columns of each frame of the data set."""
    begin = max(int(pad.stamps[0]) for pad in recording.pads.values())
    end = min(int(pad.stamps[-1]) for pad in recording.pads.values())
    times = np.array([time for time, _ in recording.grasps])
    for number in range((end - begin) * fps // SECOND + 1):
        at, before = (begin + each * SECOND // fps for each in (number, number - 1))
        columns = {}
        for pad, acquisitions in recording.pads.items():
            columns |= {f'{column_of(pad)}.{name}': value
                        for name, value in window(acquisitions, at, length)._asdict().items()}
            kinds = [kind for time, where, kind in recording.events if where == pad and before < time <= at]
            columns[f'{column_of(pad)}.events'] = np.bincount(kinds, minlength=len(KINDS)).astype(np.int64)
        latest = int(np.searchsorted(times, at, side='right')) - 1
        is_current = latest >= 0 and at - times[latest] <= GRASP_AGE
        yield columns | grasp_columns(recording.grasps[latest][1] if is_current else None)


def column_of(pad: str) -> str:
    return f'observation.{pad.replace("/", "_")}'  # LeRobot allows no slash in a name


def grasp_columns(grasp: Any) -> dict[str, np.ndarray]:
    """Return the columns of a grasp, or of no grasp if ``grasp`` is None."""
    numbers = np.full(len(NUMBERS), np.nan, np.float32)
    codes = np.zeros(len(CODES), np.int64)
    if grasp is not None:
        numbers[:] = (grasp.width, grasp.offset, grasp.misalignment, *grasp.centre, grasp.yaw, grasp.grip_force)
        codes[:] = [getattr(grasp, name) for name in CODES]
    valid = ~np.isnan(numbers)
    return {'observation.grasp': np.where(valid, numbers, np.float32(FILL)), 'observation.grasp_valid': valid,
            'observation.grasp_codes': codes}


def features_of(columns: Mapping[str, np.ndarray]) -> dict[str, dict[str, Any]]:
    """Return LeRobot's description of the columns."""
    names = {'taxels': ['acquisition', 'row', 'column'], 'valid': ['acquisition', 'row', 'column'],
             'stamp': ['acquisition'], 'events': list(KINDS), 'grasp': list(NUMBERS), 'grasp_valid': list(NUMBERS),
             'grasp_codes': list(CODES)}
    return {name: {'dtype': str(value.dtype), 'shape': value.shape, 'names': names[name.rpartition('.')[2]]}
            for name, value in columns.items()}


def valid_in(data: Mapping[str, np.ndarray], name: str) -> np.ndarray | None:
    """Return the mask of a column, or None if all its values are valid."""
    if name.endswith('.stamp'):
        return data[name] != NO_STAMP
    masks = {'taxels': f'{name.rpartition(".")[0]}.valid', 'grasp': 'observation.grasp_valid'}
    return data.get(masks.get(name.rpartition('.')[2], ''))


def write(frames: list[dict[str, np.ndarray]], folder: Path, fps: int, task: str) -> None:
    from lerobot.datasets import lerobot_dataset

    def valid_statistics(data: Mapping[str, np.ndarray], features: dict[str, Any]) -> dict[str, Any]:
        masks = {name: mask for name in data if (mask := valid_in(data, name)) is not None}
        return everything(data, features) | {name: statistics(data[name], mask) for name, mask in masks.items()}

    everything = lerobot_dataset.compute_episode_stats
    lerobot_dataset.compute_episode_stats = valid_statistics  # LeRobot offers no other way to exclude values
    dataset = lerobot_dataset.LeRobotDataset.create(
        f'local/{folder.name}', fps, features_of(frames[0]), root=folder, robot_type='tactile_skin', use_videos=False)
    for frame in frames:
        dataset.add_frame({**frame, 'task': task})
    dataset.save_episode()
    dataset.finalize()


def compare(frames: list[dict[str, np.ndarray]], folder: Path) -> int:
    """Load the data set, and return the number of values that differ in at least one bit."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    loaded = LeRobotDataset(f'local/{folder.name}', root=folder)
    assert len(loaded) == len(frames)
    return sum(loaded[number][name].numpy().tobytes() != value.tobytes()
               for number, frame in enumerate(frames) for name, value in frame.items())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('bag', type=Path)
    parser.add_argument('folder', type=Path, help='folder of the data set, which must not exist')
    parser.add_argument('--fps', type=int, default=30, help='frames per second (default: %(default)s)')
    parser.add_argument('--window', type=int, default=4, help='acquisitions in a window (default: %(default)s)')
    parser.add_argument('--task', default='hold the object', help='task of the episode (default: %(default)s)')
    args = parser.parse_args()
    try:
        frames = list(frames_of(read(args.bag), args.fps, args.window))
    except TactileError as error:
        print(f'lerobot_dataset: {error}', file=sys.stderr)
        return 2
    write(frames, args.folder, args.fps, args.task)
    different = compare(frames, args.folder)
    lost = sum(int((frame[name] == NO_STAMP).sum()) for frame in frames for name in frame if name.endswith('.stamp'))
    print(f'{len(frames)} frames of {len(frames[0])} columns; lost acquisitions in the windows: {lost}; '
          f'values that differ after loading: {different}')
    return 1 if different else 0


if __name__ == '__main__':
    sys.exit(main())
