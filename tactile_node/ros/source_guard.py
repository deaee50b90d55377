"""Detect two sources of messages on one topic, for example drivers with the same name on two hosts."""

import math

#: Time for which a source counts as present after its last message [s]. A busy machine may delay a driver by a few
#: tenths of a second just when another driver starts. A restarted process takes longer than SOURCE_HOLD to send its
#: first message. A driver that is deactivated and activated again may be faster; its first messages are then refused.
SOURCE_HOLD = 1.0
SOURCE_REACH = 10  #: number of frames by which a source may always advance; a larger advance must fit the elapsed time
SOURCE_LEAP = 1.5  #: factor by which the frame rate of a source may exceed its earlier rate
MOST_SOURCES = 16  #: maximum number of sources that the guard remembers


class Source:
    """A sequence of messages with consecutive sequence numbers."""

    def __init__(self, arrival: float, sequence: int, stamp: float):
        self.arrival, self.sequence, self.stamp = arrival, sequence, stamp
        #: True from the second message of a source on, because a single message may be spurious
        self.is_confirmed = False
        self._period = math.inf  # time between two frames of the source [s]

    def advance(self, sequence: int, stamp: float, left_out: int) -> int | None:
        """Return the number of frames since the last message, or None if the message cannot come from this source."""
        frames = sequence - self.sequence
        passed = max(0.0, stamp - self.stamp) / self._period
        return frames if 0 <= frames <= SOURCE_REACH + left_out + SOURCE_LEAP * passed else None

    def take(self, arrival: float, sequence: int, stamp: float) -> None:
        if sequence > self.sequence and stamp > self.stamp:
            self._period = (stamp - self.stamp) / (sequence - self.sequence)
        self.arrival, self.sequence, self.stamp, self.is_confirmed = arrival, sequence, stamp, True


class SourceGuard:
    """Detects a second source on a topic by the sequence numbers, which are consecutive if the topic has one source.

    While two sources send, the guard accepts no message, because it cannot know which source is the right one. A source
    counts as present once its second message arrives. The first message of a source is not accepted while another
    source sends. A restarted source is therefore accepted once the previous source has been silent for SOURCE_HOLD. The
    ROS graph cannot tell sources apart in time, because a killed publisher stays in the graph for 20 s.

    Examples
    --------

    >>> guard = SourceGuard()
    >>> [guard.accepts(0.02 * n, number, 100 + 0.02 * n) for n, number in enumerate([70, 71, 5, 72, 6, 73])]
    [True, True, False, True, False, False]
    """

    def __init__(self) -> None:
        self._sources: list[Source] = []

    def accepts(self, arrival: float, sequence: int, stamp: float, left_out: int = 0) -> bool:
        """Return True if the message comes from the only source on the topic.

        Parameters
        ----------
        arrival
            Arrival time, on this host's steady clock [s].
        sequence
            Sequence number of the message.
        stamp
            Stamp of the message, on the sender's clock [s].
        left_out
            Number of frames before the message that were overtaken at its sender or at an earlier node.
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


STAMP_TOLERANCE = 1.0  #: time by which a stamp may be ahead of the earlier stamps [s]

#: number of consecutive consistent messages that confirm a new time, after a clock was set or another source began
CONFIRMING_STAMPS = 3
#: time constant with which the limit from earlier stamps decays [s], because a clock may also be set back
STAMP_FADING = 10.0
#: upper limit of the time between two messages in the decay of the limit [s]; a longer gap counts as this time
LONGEST_GAP = 0.1


class StampGuard:
    """Rejects messages on one topic whose stamps advance by more than the time that has passed.

    A stamp, which comes from the sender's clock, may advance by the time that has passed on this host's steady clock
    plus STAMP_TOLERANCE. The class `DelayEstimator` handles late messages. A replay at a different pace advances in
    small steps, so its messages are accepted.

    Examples
    --------
    >>> guard = StampGuard()
    >>> [guard.accepts(arrival, stamp) for arrival, stamp in [(5.00, 100.00), (5.02, 3700.0), (5.04, 100.04)]]
    [True, False, True]
    """

    def __init__(self) -> None:
        self._ahead: float | None = None  # largest lead of a stamp over its arrival time [s]
        self._arrival = 0.0
        self._suspect = 0.0  # lead of the last rejected stamp [s]
        self._refused = 0  # number of consecutive rejected stamps that agree

    def accepts(self, arrival: float, stamp: float) -> bool:
        """Return True if the stamp leads by at most STAMP_TOLERANCE, or if CONFIRMING_STAMPS stamps in a row agree."""
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
