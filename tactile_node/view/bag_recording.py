"""A bag of our topics as a recording: the taxels as published, recognised again here."""

from collections.abc import Callable, Sequence

from tactile_node.errors import ConfigurationError
from tactile_node.recording.taxel_message import frame_of, geometry_of
from tactile_node.recording.topic_bag import STATUS, TAXELS, TopicBagReader, pad_of
from tactile_node.recording.window import WHOLE, Window
from tactile_node.view.facts import facts_of_status
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
