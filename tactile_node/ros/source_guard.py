"""Detect that the messages on one topic come from two sources, for example from drivers with one name on two hosts."""

import math

#: Time for which a source counts as present after its last message [s]. A busy machine may hold up a driver for some
#: tenths of a second just as another one begins. A restarted driver takes longer until its first message.
SOURCE_HOLD = 1.0
SOURCE_REACH = 10  #: number of frames by which a source may advance at any time; for more, enough time must have passed
SOURCE_LEAP = 1.5  #: factor by which a source may be faster than before
MOST_SOURCES = 16  #: number of sources that are remembered


class Source:
    """A sequence of messages with consecutive sequence numbers."""

    def __init__(self, arrival: float, sequence: int, stamp: float):
        self.arrival, self.sequence, self.stamp = arrival, sequence, stamp
        self.is_confirmed = False  #: True from the second message on, because a single message may be spurious
        self._period = math.inf  # time between two frames [s]

    def advance(self, sequence: int, stamp: float, left_out: int) -> int | None:
        """Return the number of frames since the last message, or None if this message cannot be the next one."""
        frames = sequence - self.sequence
        passed = max(0.0, stamp - self.stamp) / self._period
        return frames if 0 <= frames <= SOURCE_REACH + left_out + SOURCE_LEAP * passed else None

    def take(self, arrival: float, sequence: int, stamp: float) -> None:
        if sequence > self.sequence and stamp > self.stamp:
            self._period = (stamp - self.stamp) / (sequence - self.sequence)
        self.arrival, self.sequence, self.stamp, self.is_confirmed = arrival, sequence, stamp, True


class SourceGuard:
    """Detects a second source on a topic by the sequence numbers, which follow one another if there is one source.

    While two sources send, no message is accepted, because it is not known which source is the right one. A source
    counts from its second message on. Its first message is not accepted while another source sends. A restarted source
    is therefore used once the previous one has been silent for SOURCE_HOLD. The middleware cannot decide this: a killed
    publisher stays in its graph for 20 s.

    Examples
    --------

    >>> guard = SourceGuard()
    >>> [guard.accepts(0.02 * n, number, 100 + 0.02 * n) for n, number in enumerate([70, 71, 5, 72, 6, 73])]
    [True, True, False, True, False, False]
    """

    def __init__(self) -> None:
        self._sources: list[Source] = []

    def accepts(self, arrival: float, sequence: int, stamp: float, left_out: int = 0) -> bool:
        """Return True if the message comes from the only source.

        Parameters
        ----------
        arrival
            Time of arrival, on this host's steady clock [s].
        sequence
            Sequence number of the message.
        stamp
            Stamp of the message, on the sender's clock [s].
        left_out
            Number of frames before it that its sender left out on purpose.
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


STAMP_TOLERANCE = 1.0  #: time by which a stamp may be ahead of the earlier ones [s]
CONFIRMING_STAMPS = 3  #: number of consistent messages in a row that confirm a new time: a set clock, or another source
#: time with messages in which the limit from earlier stamps decays [s], because a clock may also be set back
STAMP_FADING = 10.0
LONGEST_GAP = 0.1  #: longest silence that counts as time with messages [s]


class StampGuard:
    """Compares stamps [s, the sender's clock] with arrivals [s, this host's steady clock] on one topic.

    A stamp may advance by the time that has passed plus STAMP_TOLERANCE. `DelayEstimator` handles late messages. A
    replay at another pace advances in small steps and is accepted.

    Examples
    --------
    >>> guard = StampGuard()
    >>> [guard.accepts(arrival, stamp) for arrival, stamp in [(5.00, 100.00), (5.02, 3700.0), (5.04, 100.04)]]
    [True, False, True]
    """

    def __init__(self) -> None:
        self._ahead: float | None = None  # largest lead of a stamp over its arrival
        self._arrival = 0.0
        self._suspect = 0.0  # lead of the last refused stamp
        self._refused = 0  # number of refused stamps in a row that agree

    def accepts(self, arrival: float, stamp: float) -> bool:
        """Return True if the stamp is at most STAMP_TOLERANCE ahead, or if CONFIRMING_STAMPS stamps in a row agree."""
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
