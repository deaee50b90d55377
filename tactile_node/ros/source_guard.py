"""Recognises that the messages of one topic come from two sources: two drivers, on two hosts, say, of the same name."""

import math

#: s for which a source that has sent nothing still counts as one. A busy machine may hold up a driver for some tenths
#: of a second just as another one begins. A driver that is started again takes longer until its first message.
SOURCE_HOLD = 1.0
SOURCE_REACH = 10  #: frames by which a source may advance at any time; more takes as long as its frames take
SOURCE_LEAP = 1.5  #: a source may be faster than it was by this factor
MOST_SOURCES = 16  #: that are remembered


class Source:
    """Messages whose sequence numbers follow one another."""

    def __init__(self, arrival: float, sequence: int, stamp: float):
        self.arrival, self.sequence, self.stamp = arrival, sequence, stamp
        self.is_confirmed = False  #: a single message may be a false one
        self._period = math.inf  # s between two frames

    def advance(self, sequence: int, stamp: float, left_out: int) -> int | None:
        """Return the frames from its newest message to this one; None when this cannot be its next."""
        frames = sequence - self.sequence
        passed = max(0.0, stamp - self.stamp) / self._period
        return frames if 0 <= frames <= SOURCE_REACH + left_out + SOURCE_LEAP * passed else None

    def take(self, arrival: float, sequence: int, stamp: float) -> None:
        if sequence > self.sequence and stamp > self.stamp:
            self._period = (stamp - self.stamp) / (sequence - self.sequence)
        self.arrival, self.sequence, self.stamp, self.is_confirmed = arrival, sequence, stamp, True


class SourceGuard:
    """Compares sequence numbers of the messages of one topic, which follow one another when they have one source.

    While two sources send, no message is accepted: which of them is the right one is not known. A source is one from
    its second message on; the first is not accepted while another source sends. So a source that has started again is
    used once the one before has been silent for SOURCE_HOLD. The middleware cannot decide it: a publisher that was
    killed stays in its graph for 20 s.

    >>> guard = SourceGuard()
    >>> [guard.accepts(0.02 * n, number, 100 + 0.02 * n) for n, number in enumerate([70, 71, 5, 72, 6, 73])]
    [True, True, False, True, False, False]
    """

    def __init__(self) -> None:
        self._sources: list[Source] = []

    def accepts(self, arrival: float, sequence: int, stamp: float, left_out: int = 0) -> bool:
        """Return whether the message is of the only source.

        ``arrival`` [s, our steady clock], ``stamp`` [s, the sender's clock]; ``left_out``: frames before it that its
        sender left out on purpose.
        """
        self._sources = [each for each in self._sources if arrival - each.arrival <= SOURCE_HOLD][-MOST_SOURCES:]
        advances = {frames: each for each in self._sources
                    if (frames := each.advance(sequence, stamp, left_out)) is not None}
        if advances:
            source = advances[min(advances)]
            source.take(arrival, sequence, stamp)
        else:
            source = Source(arrival, sequence, stamp)
            self._sources.append(source)
        is_alone = not any(each.is_confirmed for each in self._sources if each is not source)
        source.is_confirmed = source.is_confirmed or is_alone
        return is_alone


STAMP_TOLERANCE = 1.0  #: s that a stamp may be ahead of the ones before
CONFIRMING_STAMPS = 3  #: messages in a row that agree: the clock was set, or the source jumped
STAMP_FADING = 10.0  #: s with messages in which what earlier stamps allow fades: a clock may be set back, too
LONGEST_GAP = 0.1  #: s: a longer silence counts as this long


class StampGuard:
    """Compares stamps [s, the sender's clock] with arrivals [s, our steady clock] of the messages of one topic.

    A stamp may advance as far as the time that has passed, and STAMP_TOLERANCE more. What is late is another matter:
    see DelayEstimator. A replay at another pace advances by small steps and is accepted.

    >>> guard = StampGuard()
    >>> [guard.accepts(arrival, stamp) for arrival, stamp in [(5.00, 100.00), (5.02, 3700.0), (5.04, 100.04)]]
    [True, False, True]
    """

    def __init__(self) -> None:
        self._ahead: float | None = None  # the most that a stamp was ahead of its arrival
        self._arrival = 0.0
        self._suspect = 0.0  # how far the last refused stamp was ahead
        self._refused = 0  # in a row, that agree

    def accepts(self, arrival: float, stamp: float) -> bool:
        """Whether the message is no more than STAMP_TOLERANCE ahead, or the CONFIRMING_STAMPS-th in a row that is."""
        ahead = stamp - arrival
        passed, self._arrival = min(arrival - self._arrival, LONGEST_GAP), arrival
        if self._ahead is not None and ahead > self._ahead + STAMP_TOLERANCE and not self._is_confirmed(ahead):
            return False
        self._refused = 0
        more = 0.0 if self._ahead is None else max(0.0, self._ahead - ahead)
        self._ahead = ahead + more * math.exp(-passed / STAMP_FADING)
        return True

    def _is_confirmed(self, ahead: float) -> bool:
        agrees = self._refused and abs(ahead - self._suspect) <= STAMP_TOLERANCE
        self._refused = self._refused + 1 if agrees else 1
        self._suspect = ahead
        return self._refused >= CONFIRMING_STAMPS
