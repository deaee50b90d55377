"""Threads of a bus, each ends when it is stopped; when a pacer calls, and how often a message is repeated."""

import threading
import time
from collections import deque
from collections.abc import Callable, Hashable


class StoppableThread:
    """Runs ``run(stopping)`` on its own daemon thread; ``run`` returns once the event ``stopping`` is set."""

    def __init__(self, run: Callable[[threading.Event], None], name: str):
        self._run = run
        self._name = name
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin; nothing where it has begun and was not stopped."""
        if self._thread is None:
            self._stopping.clear()
            self._thread = threading.Thread(target=self._run, args=(self._stopping,), name=self._name, daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stop it and wait for its end, except on the thread itself."""
        self._stopping.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self._thread = None


LEAST_PAUSE = 0.9  #: periods between two calls that catch up: what a full bus carries is still under way


class Schedule:
    """When the next call is due, by ideal times a ``period`` apart, so that delays do not add up.

    A call that came late is followed by shorter pauses, but none below LEAST_PAUSE x period, until the ideal times are
    met again. When a whole period was missed its call is left out and counted in ``overruns``: a burst of SYNCs would
    tear frames.
    """

    def __init__(self, period: float, now: float):
        self._period = period
        self._ideal = now
        self.due = now
        self.overruns = 0

    def begin(self, at: float) -> None:
        """The call that was due begins ``at``."""
        missed = int((at - self._ideal) / self._period)
        self.overruns += missed
        self._ideal += (missed + 1) * self._period
        self.due = max(self._ideal, at + LEAST_PAUSE * self._period)


class Pacer(StoppableThread):
    """Calls ``act`` every ``period`` seconds, as Schedule says, until stopped; ``overruns``: calls left out."""

    def __init__(self, period: float, act: Callable[[], None], name: str):
        super().__init__(self._make_calls, name)
        self._period = period
        self._act = act
        self.overruns = 0

    def _make_calls(self, stopping: threading.Event) -> None:
        before, schedule = self.overruns, Schedule(self._period, time.monotonic())
        while not stopping.wait(max(0.0, schedule.due - time.monotonic())):
            schedule.begin(time.monotonic())
            self.overruns = before + schedule.overruns
            self._act()


FIRST_REMINDER, LAST_REMINDER = 2.0, 60.0  # s between two messages of one kind


class Reminder:
    """Lets a message of a new kind through at once, of the same kind again ever more rarely."""

    def __init__(self) -> None:
        self._kind = ''
        self._due = 0.0
        self._pause = FIRST_REMINDER

    def is_due(self, kind: str, now: float) -> bool:
        """Whether to send the message now, and note that it is sent."""
        if kind == self._kind and now < self._due:
            return False
        self._pause = min(2 * self._pause, LAST_REMINDER) if kind == self._kind else FIRST_REMINDER
        self._kind = kind
        self._due = now + self._pause
        return True

    def reset(self) -> None:
        self._kind = ''


STATE_PERIOD = 1.0  #: s, at the latest after which the state is published again (REP-107)
MOST_STATES = 20    #: published within any STATE_PERIOD
STATE_MARGIN = 0.05  #: s from a decision to its publication, at most: no reader sees more than MOST_STATES in a period
EARLY_ROUND = 0.02   #: s: a round that comes a little early is the last one before the period is over


class ChangePace:
    """Lets a state through when it has changed, MOST_STATES times in a STATE_PERIOD at most, and after each.

    A change that comes too soon is let through by a later call, unless the state has changed back.
    """

    def __init__(self) -> None:
        self._published: deque[float] = deque(maxlen=MOST_STATES)
        self._key: Hashable = None

    def is_due(self, key: Hashable, now: float) -> bool:
        """Whether to publish the state ``key`` now, and note that it is published."""
        is_over = not self._published or now - self._published[-1] >= STATE_PERIOD - EARLY_ROUND
        if key == self._key and not is_over:
            return False
        if len(self._published) == MOST_STATES and now - self._published[0] < STATE_PERIOD + STATE_MARGIN:
            return False
        self.note(key, now)
        return True

    def note(self, key: Hashable, now: float) -> None:
        """The state is published now."""
        self._published.append(now)
        self._key = key
