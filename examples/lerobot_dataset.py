"""Convert a bag with the topics of a skin to a LeRobot v3 data set, load the data set again, and compare it.

    pip install lerobot==0.4.4 '.[bag]'     # in a separate environment, because LeRobot requires exact versions
    python examples/lerobot_dataset.py BAG FOLDER [--fps 30] [--window 4] [--task TEXT]

The bag needs <pad>/taxels, and may contain <pad>/shape, <pad>/events and grasp. The data set has no column for a topic
that was not recorded. The data set has one episode. In each of its frames, a pad has a window of the latest
acquisitions, one for each SYNC period, the newest last:

- observation.PAD.taxels: values [unit of the skin], FILL where no valid value exists
- observation.PAD.valid: True where a value is valid. The value of a saturated taxel is valid, but a lower bound. The
  whole mask is False for a lost acquisition, and for an acquisition in which no taxel has a valid value.
- observation.PAD.stamp: acquisition stamps [ns], or NO_STAMP for an acquisition that is lost, late by more than half a
  period, or earlier than the recording
- observation.PAD.shape: code of the latest shape
- observation.PAD.events: number of events since the previous frame of the data set, by kind
- observation.grasp, observation.grasp_valid, observation.grasp_codes: latest grasp (NUMBERS, CODES)

In meta/info.json, each column with codes has an entry `codes` with the names of the codes, in the order of their
numbers. A shape or a grasp that is older than MOST_AGE is not used. All its codes are then 0.

A policy has to read the mask. FILL lies far outside the range of any skin, so a policy that ignores the mask fails
visibly. The statistics of the data set use valid values only. For a value that was never valid, they are FILL with a
standard deviation of 1.
"""

import argparse
import sys
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from itertools import count, takewhile
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tactile_node.code_names import name_of
from tactile_node.errors import ConfigurationError, InputError, TactileError

FILL = -1e6            #: value under the mask
NO_STAMP = -1          #: stamp of a lost acquisition
SECOND = 10**9         #: [ns]
MOST_AGE = SECOND // 10  #: time after which the latest shape or grasp is no longer used [ns]
NUMBERS = ('width', 'offset', 'misalignment', 'centre_x', 'centre_y', 'yaw', 'grip_force')  #: fields of Grasp [SI]
CODES = ('contact', 'shape', 'fresh', 'stable')  #: fields of Grasp; 0 if there is no current grasp
TOPICS = {'TaxelArray': 'taxels', 'ContactShape': 'shape', 'ContactEvent': 'events', 'Grasp': 'grasp'}
QUANTILES = {'q01': 0.01, 'q10': 0.1, 'q50': 0.5, 'q90': 0.9, 'q99': 0.99}  #: as LeRobot names them


def codes_of(message: str, field: str) -> list[str]:
    """Return the names of a field's codes 0, 1, ... from the message definition.

    >>> codes_of('Grasp', 'contact')
    ['not_known', 'unseen', 'no_contact', 'one_sided', 'two_sided']
    """
    found = (name_of(f'msg/{message}', field, code) for code in count())
    return [name.lower() for name in takewhile(str.isidentifier, found)]


KINDS = codes_of('ContactEvent', 'kind')


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
    #: time and message of each shape, event and grasp, in order of time, by topic. A topic that was not recorded is
    #: omitted.
    messages: Mapping[str, Sequence[tuple[int, Any]]]

    @property
    def missing(self) -> list[str]:
        """Topics that were not recorded."""
        wanted = [topic_of(pad, name) for pad in self.pads for name in ('shape', 'events')] + ['grasp']
        return [topic for topic in wanted if topic not in self.messages]

    def latest(self, topic: str, at: int) -> Any:
        """Return the latest message of a topic at the time ``at`` [ns], or None if it is too old."""
        messages = self.messages[topic]
        number = bisect_right(messages, at, key=itemgetter(0)) - 1
        return messages[number][1] if number >= 0 and at - messages[number][0] <= MOST_AGE else None


def topic_of(pad: str, name: str) -> str:
    return 'grasp' if name == 'grasp' else f'{pad}/{name}'


def read(bag: Path) -> Recording:
    """Read a bag. Raises a TactileError if it has no taxels, or if the driver was restarted during the recording."""
    from tactile_node.errors import LogError
    from tactile_node.logs.topic_bag import TopicBagReader, pad_of

    reader = TopicBagReader(bag)
    types = {f'tactile_skin/msg/{kind}': name for kind, name in TOPICS.items()}
    kinds = [kind for kind in reader.topics.values() if types.get(kind) == 'grasp']
    if len(kinds) > 1:
        raise LogError(str(bag), expected='the grasps of one gripper', got=f'{len(kinds)} topics with grasps',
                       remedy='Record each gripper in a separate bag.')
    found: dict[str, list[tuple[int, Any]]] = {
        topic_of(pad_of(topic), types[kind]): [] for topic, kind in reader.topics.items() if kind in types}
    for message in reader.messages(types):
        topic = topic_of(pad_of(message.topic), types[message.type])
        found[topic].append((round(message.stamp * SECOND), message.content))
    for each in reader.damages:
        print(f'lerobot_dataset: missing in the bag: {each}', file=sys.stderr)
    pads = {}
    for pad in reader.pads:
        arrays = [content for _, content in found.pop(topic_of(pad, 'taxels'))]
        sequences = np.array([each.sequence for each in arrays], np.int64)
        if len(arrays) < 2 or (np.diff(sequences) <= 0).any():
            raise LogError(f'{bag}, pad {pad}', expected='rising sequence numbers of at least two acquisitions',
                           got=f'{len(arrays)} acquisitions, '
                           f'{np.count_nonzero(np.diff(sequences) <= 0)} of them out of order',
                           remedy='Record one run of the driver in one bag.')
        pads[pad] = Acquisitions(
            sequences, np.array([each.header.stamp.sec * SECOND + each.header.stamp.nanosec for each in arrays]),
            np.array([np.reshape(each.values, (each.rows, each.cols)) for each in arrays], np.float32))
    return Recording(pads, {topic: sorted(messages, key=itemgetter(0)) for topic, messages in found.items()})


def frames_of(recording: Recording, fps: int, length: int) -> Iterator[dict[str, np.ndarray]]:
    """Yield the columns of each frame of the data set."""
    begin = max(int(pad.stamps[0]) for pad in recording.pads.values())
    end = min(int(pad.stamps[-1]) for pad in recording.pads.values())
    for number in range((end - begin) * fps // SECOND + 1):
        at, before = (begin + each * SECOND // fps for each in (number, number - 1))
        columns: dict[str, np.ndarray] = {}
        for pad, acquisitions in recording.pads.items():
            columns |= {f'{column_of(pad)}.{name}': value
                        for name, value in window(acquisitions, at, length)._asdict().items()}
            if (topic := f'{pad}/shape') in recording.messages:
                shape = recording.latest(topic, at)
                columns[f'{column_of(pad)}.shape'] = np.array([0 if shape is None else shape.shape], np.int64)
            if (topic := f'{pad}/events') in recording.messages:
                kinds = [event.kind for time, event in recording.messages[topic] if before < time <= at]
                columns[f'{column_of(pad)}.events'] = np.bincount(
                    np.array(kinds, np.int64), minlength=len(KINDS)).astype(np.int64)
        if 'grasp' in recording.messages:
            columns |= grasp_columns(recording.latest('grasp', at))
        yield columns


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
             'stamp': ['acquisition'], 'shape': ['shape'], 'events': KINDS, 'grasp': list(NUMBERS),
             'grasp_valid': list(NUMBERS), 'grasp_codes': list(CODES)}
    shapes = codes_of('ContactShape', 'shape')
    switch = ['false', 'true']
    codes = {'shape': {'shape': shapes}, 'grasp_codes': {
        'contact': codes_of('Grasp', 'contact'), 'shape': shapes, 'fresh': switch, 'stable': switch}}
    described = {}
    for name, value in columns.items():
        last = name.rpartition('.')[2]
        described[name] = {'dtype': str(value.dtype), 'shape': value.shape, 'names': names[last]} | (
            {'codes': codes[last]} if last in codes else {})
    return described


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


def missing_slots(frames: Sequence[Mapping[str, np.ndarray]]) -> tuple[int, int]:
    """Return how many places in all windows have no acquisition, and how many have one without any valid value."""
    absent = empty = 0
    for frame in frames:
        for name in (name for name in frame if name.endswith('.stamp')):
            has_stamp = frame[name] != NO_STAMP
            has_value = frame[f'{name.removesuffix("stamp")}valid'].any(axis=(1, 2))
            absent, empty = absent + int((~has_stamp).sum()), empty + int((has_stamp & ~has_value).sum())
    return absent, empty


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('bag', type=Path)
    parser.add_argument('folder', type=Path, help='folder of the data set, which must not exist')
    parser.add_argument('--fps', type=int, default=30, help='frames per second (default: %(default)s)')
    parser.add_argument('--window', type=int, default=4, help='acquisitions in a window (default: %(default)s)')
    parser.add_argument('--task', default='hold the object', help='task of the episode (default: %(default)s)')
    args = parser.parse_args()
    try:
        if find_spec('lerobot') is None:
            raise ConfigurationError('Python environment', expected='LeRobot', got=f'no lerobot in {sys.prefix}',
                                     remedy='Install it in a separate environment, as docs/recordings.md shows, and '
                                     'run this example with the python of that environment.')
        if args.folder.exists():
            raise InputError(f'output {str(args.folder)!r}', expected='a folder that does not exist',
                             got='an existing one', remedy='Give another path, or remove the folder.')
        recording = read(args.bag)
    except TactileError as error:
        print(f'lerobot_dataset: {error}', file=sys.stderr)
        return 2
    if recording.missing:
        print(f'Not recorded, so not in the data set: {", ".join(recording.missing)}')
    frames = list(frames_of(recording, args.fps, args.window))
    write(frames, args.folder, args.fps, args.task)
    different = compare(frames, args.folder)
    absent, empty = missing_slots(frames)
    print(f'{len(frames)} frames of {len(frames[0])} columns; places in the windows without an acquisition: {absent}, '
          f'with an acquisition that has no valid value: {empty}; values that differ after loading: {different}')
    return 1 if different else 0


if __name__ == '__main__':
    sys.exit(main())
