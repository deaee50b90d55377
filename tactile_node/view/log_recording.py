"""A CAN log as a recording: taxel frames as the driver would assemble them."""

from collections.abc import Callable

from tactile_node.frames.fault_text import failure_text
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.recording.log_source import LogSource
from tactile_node.recording.window import WHOLE, Window
from tactile_node.skin.pads import PadSettings
from tactile_node.view.facts import facts_of
from tactile_node.view.timeline import Timeline

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
