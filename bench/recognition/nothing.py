"""Measure pads that nothing presses: how often a frame is called a shape, and how long a stream reports a shape.

Each kind is measured separately, in sequences of FRAMES frames at intervals of PERIOD. The training imports nothing
from here.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple, Protocol

import numpy as np

from bench.recognition.figures import Rate
from bench.recognition.idle import IDLE, Idle
from bench.recognition.page import Table
from tactile_node import ContactStream, Recogniser, find_contact
from tactile_node.shape.recognition import Shape

FRAMES = 50
PERIOD = 0.02             #: Time between two frames [s].
SIDES = (16,) * 7 + (8, 32, 64)  #: Rows and columns of the pads, used in turn.
ENOUGH = 200              #: Number of sequences of a kind, which have 10,000 frames together.
MOST_CALLED = 0.001       #: Largest share of the frames of a kind that may be called a shape.
LONGEST = 0.1             #: Longest time for which a shape may stay on the topic [s].
SHAPES = tuple(shape for shape in Shape if shape not in (Shape.NONE, Shape.UNKNOWN))


class Stream(Protocol):
    """Interface of an object that follows one pad, as the library's ContactStream does."""

    def update(self, values: np.ndarray, stamp: float): ...


Recognise = Callable[[np.ndarray], Shape]
NewStream = Callable[[], Stream]


class Seen(NamedTuple):
    """Result for one kind."""

    kind: str
    called: Rate          #: single frames that are called one of the five shapes
    by_shape: dict[Shape, int]
    longest: float        #: longest time for which a stream reports a shape without a break [s]
    streams: Rate         #: sequences in which a stream reports a shape for more than LONGEST

    @property
    def is_met(self) -> bool:
        return self.called.value <= MOST_CALLED and self.longest <= LONGEST + 1e-9


def measured(rng: np.random.Generator, kind: str, recognise: Recognise, new_stream: NewStream,
             sequences: int = ENOUGH) -> Seen:
    """Return the shapes of single frames, and the shapes that a stream reports for each sequence.

    ``recognise`` returns the shape of a single frame, and ``new_stream`` makes an object that follows a pad. Frames are
    bool, or float in fractions of full scale.
    """
    by_shape, frames, times = dict.fromkeys(SHAPES, 0), 0, []
    for idle in drawn(rng, kind, sequences):
        found, reported = _followed(new_stream(), idle)
        if not idle.begin:  # left-over taxels are known only from earlier frames
            found = [recognise(frame) for frame in idle.frames]
        frames += len(found)
        for shape in found:
            if shape in SHAPES:
                by_shape[shape] += 1
        times.append(PERIOD * longest_run(reported))
    too_long = sum(time > LONGEST + 1e-9 for time in times)
    return Seen(kind, Rate(sum(by_shape.values()), frames), by_shape, max(times), Rate(too_long, len(times)))


def library(recogniser: Recogniser) -> tuple[Recognise, NewStream]:
    """Return the functions with which the library, without options, recognises single frames and follows a pad."""
    def recognise(frame: np.ndarray) -> Shape:
        return recogniser.recognise(find_contact(frame, unit=None)).shape

    def new_stream() -> Stream:
        return ContactStream(recogniser, unit=None)
    return recognise, new_stream


def table(found: list[Seen]) -> Table:
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
    """Draw sequences of a kind on pads of SIDES in turn, until ``sequences`` times FRAMES frames count."""
    count, number = 0, 0
    while count < sequences * FRAMES:
        idle = IDLE[kind](rng, FRAMES, SIDES[number % len(SIDES)])
        count, number = count + len(idle.frames) - idle.begin, number + 1
        yield idle


def longest_run(reported: np.ndarray) -> int:
    """Return the length of the longest run of True in ``reported``, (n,).

    >>> longest_run(np.array([True, False, True, True]))
    2
    """
    ends = np.flatnonzero(~np.concatenate(([False], reported, [False])))
    return int(np.diff(ends).max() - 1)


def _followed(stream: Stream, idle: Idle) -> tuple[list[Shape], np.ndarray]:
    """Return for each frame in which nothing presses its shape, and True if a shape is on the topic after it."""
    found = [stream.update(frame, PERIOD * k) for k, frame in enumerate(idle.frames)][idle.begin:]
    return [each.recognition.shape for each in found], np.array([each.fused.recognition.shape in SHAPES
                                                                 for each in found])
