"""Measure how often, and for how long, a shape is reported for untouched pads.

Each kind of disturbance is measured separately, in sequences of FRAMES frames at intervals of PERIOD. The training must
not import this module.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple, Protocol

import numpy as np

from bench.recognition.figures import PercentRate
from bench.recognition.idle import IDLE, Idle
from bench.recognition.page import Table
from tactile_node import ContactStream, Recogniser, find_contact
from tactile_node.shape.recognition import Shape

FRAMES = 50
PERIOD = 0.02             #: Time between two frames [s].
SIDES = (16,) * 7 + (8, 32, 64)  #: Side lengths of the square pads, used in turn [taxels].
ENOUGH = 200              #: Number of sequences of each kind, with 10,000 frames in total.
MOST_CALLED = 0.001       #: Largest allowed share of frames of one kind that are reported as a shape.
LONGEST = 0.1             #: Longest allowed time for which a shape stays on the topic [s].
SHAPES = tuple(shape for shape in Shape if shape not in (Shape.NONE, Shape.UNKNOWN))


class Stream(Protocol):
    """Interface of a stream that follows one pad, such as the library's ContactStream."""

    def update(self, values: np.ndarray, stamp: float): ...


Recognise = Callable[[np.ndarray], Shape]
NewStream = Callable[[], Stream]


class DisturbanceResult(NamedTuple):
    """Result for one kind of disturbance."""

    kind: str
    called: PercentRate   #: single frames that are reported as one of the five shapes
    by_shape: dict[Shape, int]
    longest: float        #: longest time for which a stream reports shapes without a break [s]
    streams: PercentRate  #: sequences in which a stream reports a shape for more than LONGEST

    @property
    def is_met(self) -> bool:
        return self.called.value <= MOST_CALLED and self.longest <= LONGEST + 1e-9


def measured(rng: np.random.Generator, kind: str, recognise: Recognise, new_stream: NewStream,
             sequences: int = ENOUGH) -> DisturbanceResult:
    """Count the shapes reported for single frames, and measure how long a stream reports a shape.

    ``recognise`` returns the shape of a single frame, and ``new_stream`` makes a stream for one pad. The frames are
    bool, or float in fractions of full scale.
    """
    by_shape, frames, times = dict.fromkeys(SHAPES, 0), 0, []
    for idle in drawn(rng, kind, sequences):
        found, reported = _followed(new_stream(), idle)
        if not idle.begin:  # single frames cannot show left-over taxels, which are known only from earlier frames
            found = [recognise(frame) for frame in idle.frames]
        frames += len(found)
        for shape in found:
            if shape in SHAPES:
                by_shape[shape] += 1
        times.append(PERIOD * longest_run(reported))
    too_long = sum(time > LONGEST + 1e-9 for time in times)
    return DisturbanceResult(kind, PercentRate(sum(by_shape.values()), frames), by_shape, max(times),
                             PercentRate(too_long, len(times)))


def library(recogniser: Recogniser) -> tuple[Recognise, NewStream]:
    """Return the library's functions that recognise a frame and make a new stream, with default settings."""
    def recognise(frame: np.ndarray) -> Shape:
        return recogniser.recognise(find_contact(frame, unit=None)).shape

    def new_stream() -> Stream:
        return ContactStream(recogniser, unit=None)
    return recognise, new_stream


def table(found: list[DisturbanceResult]) -> Table:
    made = Table('Nothing presses', f'{FRAMES} frames in each sequence at {1 / PERIOD:g} Hz, square pads of '
                 f'{min(SIDES)} to {max(SIDES)} taxels a side; share of single frames called one of the five shapes '
                 '[%] (for left-over taxels, the frames follow each other), and longest time for which a stream has a '
                 f'shape on the topic. Required: at most {100 * MOST_CALLED:g} % and '
                 f'{LONGEST:g} s', ['kind', 'frames', 'called a shape, %', 'most often', 'on the topic, s',
                                    f'sequences over {LONGEST:g} s, %', 'required'])
    for seen in found:
        often = max(seen.by_shape, key=lambda shape: seen.by_shape[shape])
        made.add(seen.kind, seen.called.total, seen.called, often.value if seen.called.right else '',
                 f'{seen.longest:.2f}', f'{100 * seen.streams.value:.1f}', 'met' if seen.is_met else 'NOT MET')
    return made


def drawn(rng: np.random.Generator, kind: str, sequences: int) -> Iterator[Idle]:
    """Draw sequences of ``kind`` on pads of SIDES in turn, with ``sequences`` times FRAMES idle frames in total."""
    count, number = 0, 0
    while count < sequences * FRAMES:
        idle = IDLE[kind](rng, FRAMES, SIDES[number % len(SIDES)])
        count, number = count + len(idle.frames) - idle.begin, number + 1
        yield idle


def longest_run(reported: np.ndarray) -> int:
    """Return the length of the longest run of True values in ``reported``.

    >>> longest_run(np.array([True, False, True, True]))
    2
    """
    ends = np.flatnonzero(~np.concatenate(([False], reported, [False])))
    return int(np.diff(ends).max() - 1)


def _followed(stream: Stream, idle: Idle) -> tuple[list[Shape], np.ndarray]:
    """Return the shape of each idle frame, and an array that is True if the topic carries a shape after the frame."""
    found = [stream.update(frame, PERIOD * k) for k, frame in enumerate(idle.frames)][idle.begin:]
    return [each.recognition.shape for each in found], np.array([each.fused.recognition.shape in SHAPES
                                                                 for each in found])
