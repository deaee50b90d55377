"""What a view shows again: taxels of a bag as published, or of a CAN log as the driver would assemble them."""

from collections.abc import Callable, Sequence

from tactile_node.errors import ConfigurationError
from tactile_node.frames.fault_text import failure_text
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.recording.log_source import LogSource
from tactile_node.recording.taxel_message import frame_of, geometry_of
from tactile_node.recording.topic_bag import STATUS, TAXELS, TopicBagReader, pad_of
from tactile_node.recording.window import WHOLE, Window
from tactile_node.skin.pads import PadSettings
from tactile_node.view.states import facts_of, facts_of_status
from tactile_node.view.timeline import Timeline


class BagRecording:
    """A `Recording` of ``pads``, or of all. Raises LogError for a bag without our taxel arrays, ConfigurationError."""

    def __init__(self, path: str, pads: Sequence[str] = (), window: Window = WHOLE):
        self._reader, self._window = TopicBagReader(path), window
        self.title = path
        if missing := [pad for pad in pads if pad not in self._reader.pads]:
            raise ConfigurationError('--pads', expected=f'some of {", ".join(self._reader.pads)}, as in the bag',
                                     got=', '.join(missing), remedy='Leave it out for all of them.')
        self.pads = tuple(pads) or self._reader.pads

    def check(self) -> None:
        """Nothing more: it has been opened."""

    def read(self, timeline: Timeline, is_stopping: Callable[[], bool]) -> str:
        others = 0
        for message in self._reader.messages((TAXELS, STATUS), window=self._window):
            if is_stopping():
                return ''
            if message.type == STATUS:
                timeline.add_facts(message.stamp, facts_of_status(message.content))
                continue
            if pad_of(message.topic) not in self.pads:
                continue
            geometry = geometry_of(message.content)
            others += not timeline.add(pad_of(message.topic), frame_of(message.content), geometry.pitch, geometry.unit)
        unread = [f'{count} {reason.name.lower()}' for reason, count in self._reader.unread.items()]
        unread += [f'{others} of another size than the first'] if others else []
        return f'not shown: {", ".join(unread)} (last: {self._reader.problem})' if unread else ''


FACTS_PERIOD = 0.5  #: of the log's time [s]
LOOK = 0.2          #: for the end of the reading [s]


class LogRecording:
    """A `Recording`; ``channel`` chooses one bus of a log of several."""

    def __init__(self, path: str, pads: tuple[PadSettings, ...], channel: str = '', any_device: bool = False,
                 window: Window = WHOLE):
        self._path, self._settings = path, pads
        self._channel, self._any_device, self._window = channel, any_device, window
        self._geometry = {pad.name: (pad.layout.pitch, pad.layout.value.unit) for pad in pads}
        self.title = path
        self.pads = tuple(pad.name for pad in pads)

    def check(self) -> None:
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
                timeline.add_facts(stamp, facts_of(source.statistics(), source.health(), load_is_known=False))

        source = self._source(on_frame, on_time)
        source.open()
        source.start()
        while not source.finished.wait(LOOK) and not is_stopping():
            pass
        source.close()
        timeline.add_facts(looked, facts_of(source.statistics(), source.health(), load_is_known=False))
        return failure_text(source.failure) or _of_others(source) or _without_taxels(timeline) or _unread(source)

    def _source(self, on_frame: Callable[[str, TaxelFrame], None], on_time: Callable[[float], None]) -> LogSource:
        return LogSource(self._path, self._settings, on_frame, pace=None, channel=self._channel, on_time=on_time,
                         any_device=self._any_device, window=self._window)


def _of_others(source: LogSource) -> str:
    """Nodes of other node-IDs that send the same COB-IDs: what is shown may be theirs."""
    return '; '.join(f'pad {pad}: node {", ".join(map(str, nodes))} sends its COB-IDs, not its own: check --node-id'
                     for pad, nodes in source.strangers.items())


def _unread(source: LogSource) -> str:
    unread = source.statistics().unread
    return f'not shown: {unread} lines or rests that could not be read (last: {source.problem})' if unread else ''


def _without_taxels(timeline: Timeline) -> str:
    return '' if timeline.begin <= timeline.end else 'no taxel frame of these pads in the log: check --node-id'
