"""Recordings that a view can play: a bag of published taxel arrays, or a CAN log, assembled as in the driver."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from tactile_node.assembly.facts import BusFacts
from tactile_node.errors import ConfigurationError
from tactile_node.logs.replay_times import WHOLE, TimeWindow
from tactile_node.logs.topic_bag import STATUS, TAXELS, TopicBagReader, frame_of, pad_of
from tactile_node.skin.pads import PadSettings
from tactile_node.sources.log_source import LogSource
from tactile_node.taxel_frame import TaxelFrame
from tactile_node.viewing.timeline import Timeline


class BagRecording:
    """A bag with taxel arrays.

    Parameters
    ----------
    path
        Path of the bag.
    pads
        Pads to show, or empty for all pads in the bag.
    window
        Part of the bag to show.

    Raises
    ------
    LogError
        Raised if the bag has no taxel arrays of this package.
    ConfigurationError
        Raised if a pad is not in the bag.
    """

    def __init__(self, path: str, pads: Sequence[str] = (), window: TimeWindow = WHOLE):
        self._reader, self._window = TopicBagReader(path), window
        self.title = path
        if missing := [pad for pad in pads if pad not in self._reader.pads]:
            raise ConfigurationError('--pads', expected=f'some of {", ".join(self._reader.pads)}, as in the bag',
                                     got=', '.join(missing), remedy='Leave out --pads to show all pads.')
        self.pads = tuple(pads) or self._reader.pads

    def check(self) -> None:
        """Do nothing, because `__init__` has already opened the bag."""

    def read(self, timeline: Timeline, is_stopping: Callable[[], bool]) -> str:
        """Read the whole bag as fast as possible. Return a description of unreadable parts, or '' if there are none."""
        others = 0
        for message in self._reader.messages((TAXELS, STATUS), window=self._window):
            if is_stopping():
                return ''
            if message.type == STATUS:
                timeline.add_facts(message.stamp, message.content)
                continue
            if pad_of(message.topic) not in self.pads:
                continue
            taxels = message.content
            others += not timeline.add(pad_of(message.topic), frame_of(taxels), float(taxels.pitch), taxels.unit)
        unread = [f'{count} {reason.name.lower()}' for reason, count in self._reader.unread.items()]
        unread += [f'{others} of another size than the first'] if others else []
        return f'not shown: {", ".join(unread)} (last: {self._reader.problem})' if unread else ''


FACTS_PERIOD = 0.5  #: period at which the bus state is read [s], in log time for a log
READ_POLL = 0.2      #: polling period while a log is being read [s]


class LogRecording:
    """A CAN log.

    Parameters
    ----------
    path
        Path of the log.
    pads
        Pads to show.
    channel, any_device, eds
        As in `LogSource`.
    window
        Part of the log to show.
    """

    def __init__(self, path: str, pads: tuple[PadSettings, ...], channel: str = '', any_device: bool = False,
                 window: TimeWindow = WHOLE, eds: Sequence[str] = ('',)):
        self._path, self._settings = path, pads
        self._channel, self._any_device, self._window = channel, any_device, window
        self._eds = eds
        self._geometry = {pad.name: (pad.layout.pitch, pad.layout.value.unit) for pad in pads}
        self.title = path
        self.pads = tuple(pad.name for pad in pads)

    def check(self) -> None:
        """Raise LogError if the log cannot be read at all."""
        source = self._source(lambda pad, frame: None, lambda stamp: None)
        source.open()
        source.close()

    def read(self, timeline: Timeline, is_stopping: Callable[[], bool]) -> str:
        looked = 0.0

        def on_frame(pad: str, frame: TaxelFrame) -> None:
            timeline.add(pad, frame, *self._geometry[pad])

        def on_time(stamp: float) -> None:
            nonlocal looked
            if not 0 <= stamp - looked < FACTS_PERIOD:
                looked = stamp
                timeline.add_facts(stamp, _shown(source.facts()))

        source = self._source(on_frame, on_time)
        source.open()
        source.start()
        while not source.finished.wait(READ_POLL) and not is_stopping():
            pass
        source.close()
        timeline.add_facts(looked, _shown(source.facts()))
        if source.failure is not None:
            return str(source.failure)
        return _of_others(source) or _without_taxels(timeline) or _unread(source)

    def _source(self, on_frame: Callable[[str, TaxelFrame], None], on_time: Callable[[float], None]) -> LogSource:
        return LogSource(self._path, self._settings, on_frame, pace=None, channel=self._channel, on_time=on_time,
                         any_device=self._any_device, window=self._window, eds=self._eds)


def _shown(facts: BusFacts) -> BusFacts:
    """Return the facts about a log without the unknown bus load, and without the many counts that no view shows."""
    return replace(facts, bus_load=math.nan,
                   pads=tuple(replace(pad, distinct_by_tpdo=(), fresh_by_tpdo=()) for pad in facts.pads))


def _of_others(source: LogSource) -> str:
    """Return a warning if other nodes send a pad's COB-IDs, because the taxels may belong to those nodes."""
    return '; '.join(f'pad {pad}: node {", ".join(map(str, nodes))} sends its COB-IDs, not its own: check --node-id'
                     for pad, nodes in source.heard.strangers().items())


def _unread(source: LogSource) -> str:
    unread, last = source.facts().unread_log_lines, source.reader.problem
    return f'not shown: {unread} lines or parts that could not be read (last: {last})' if unread else ''


def _without_taxels(timeline: Timeline) -> str:
    return '' if timeline.begin <= timeline.end else 'no taxel frame of these pads in the log: check --node-id'
