"""Recordings that a view plays and a report describes: a bag of published taxel arrays, or a CAN log.

The frames of a log are assembled as in the driver.
"""

import math
import threading
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import can

from tactile_node.assembly.facts import BusFacts
from tactile_node.assembly.router import non_data_kind
from tactile_node.code_names import name_of
from tactile_node.errors import ConfigurationError
from tactile_node.logs.damage import Damage
from tactile_node.logs.logged_set_up import Contradiction, LoggedSetUp
from tactile_node.logs.replay_times import WHOLE, TimeWindow
from tactile_node.logs.topic_bag import GRASP, STATUS, TAXELS, TopicBagReader, frame_of, pad_of, seconds
from tactile_node.skin.pads import PadSettings, identities_of
from tactile_node.sources.log_source import LogSource
from tactile_node.taxel_frame import TaxelFrame
from tactile_node.viewing.states import GraspFacts

CHECKED_TIME = 5.0  #: length of the beginning of a log that is checked before the log is shown [s]
FACTS_PERIOD = 0.5  #: period, in log time, at which the bus state is read [s]


class Sink:
    """Receives everything that a recording contains. A subclass ignores whatever it does not override."""

    def add(self, pad: str, frame: TaxelFrame, pitch: float, unit: str) -> bool:
        """Add a frame, or return False without adding it if its geometry differs from the pad's first frame."""
        raise NotImplementedError

    def add_facts(self, stamp: float, facts: Any) -> None:
        """Add facts about the bus, or a SkinStatus message, at ``stamp`` [s]."""

    def add_message(self, message: can.Message) -> None:
        """Add a CAN frame of a log."""

    def add_grasp(self, stamp: float, grasp: GraspFacts, acquired: float) -> None:
        """Add a grasp that was published at ``stamp`` [s], from data acquired at ``acquired`` [s]."""


class BagRecording:
    """A bag with taxel arrays.

    Parameters
    ----------
    path
        Path of the bag.
    pads
        Pads to read, or empty for all pads in the bag.
    window
        Part of the bag to read.

    Attributes
    ----------
    title
        Path of the bag.
    pads
        Names of the pads that are read.

    Raises
    ------
    LogError
        Raised if the bag has no taxel arrays of this package.
    ConfigurationError
        Raised if a pad is not in the bag.
    """

    def __init__(self, path: str, pads: Sequence[str] = (), window: TimeWindow = WHOLE):
        self._reader = TopicBagReader(path)
        self.title, self._window = path, window
        if missing := [pad for pad in pads if pad not in self._reader.pads]:
            raise ConfigurationError('--pads', expected=f'some of {", ".join(self._reader.pads)}, as in the bag',
                                     got=', '.join(missing), remedy='Leave out --pads to show all pads.')
        self.pads = tuple(pads) or self._reader.pads
        self._others = 0  # number of taxel arrays of another size

    def check(self) -> None:
        """Do nothing, because `__init__` has already opened the bag."""

    def read(self, sink: Sink, stop_requested: threading.Event) -> None:
        """Read the whole bag as fast as possible into ``sink``, or until ``stop_requested`` is set."""
        grasps = [topic for topic, kind in self._reader.topics.items() if kind == GRASP]
        types = (TAXELS, STATUS, GRASP) if len(grasps) == 1 else (TAXELS, STATUS)  # a view shows only one gripper
        for message in self._reader.messages(types, window=self._window):
            if stop_requested.is_set():
                return
            if message.type == STATUS:
                sink.add_facts(message.stamp, message.content)
            elif message.type == GRASP:
                grasp = message.content
                sink.add_grasp(message.stamp, _grasp_facts(grasp), seconds(grasp.header.stamp))
            elif pad_of(message.topic) in self.pads:
                taxels = message.content
                self._others += not sink.add(pad_of(message.topic), frame_of(taxels), float(taxels.pitch), taxels.unit)

    @property
    def unread(self) -> int:
        """Number of messages or parts that could not be read."""
        return self._reader.unread + self._others

    @property
    def problem(self) -> str:
        """Reason why the last unread part could not be read."""
        return self._reader.problem or ('taxel arrays of another size' if self._others else '')

    @property
    def damages(self) -> tuple[Damage, ...]:
        """Damaged places in the bag."""
        return tuple(self._reader.damages)

    @property
    def doubt(self) -> str:
        """Reason why the frames that were read may be wrong or missing, or ''."""
        return ''


class LogRecording:
    """A CAN log.

    The recording yields no further frames of a pad once the device set-up in the log contradicts the layout or EDS.

    Parameters
    ----------
    path
        Path of the log.
    pads
        Pads to read.
    channel
        As in `LogSource`.
    any_device
        True to read the taxels even if they may come from another device.
    window
        Part of the log to read.
    eds
        As in `LogSource`.

    Attributes
    ----------
    title
        Path of the log.
    pads
        Names of the pads.
    settings
        Pads, with their layouts.
    any_device
        True if the taxels are read even if they may come from another device.
    contradictions
        Contradiction that was found for each pad, by name of the pad.
    source
        Source of the frames, whose facts can be read at any time.
    """

    def __init__(self, path: str, pads: tuple[PadSettings, ...], channel: str = '', any_device: bool = False,
                 window: TimeWindow = WHOLE, eds: Sequence[str] = ('',)):
        self.title, self.settings, self.any_device = path, pads, any_device
        self.pads = tuple(pad.name for pad in pads)
        self.contradictions: dict[str, Contradiction] = {}
        self._geometry = {pad.name: (pad.layout.pitch, pad.layout.value.unit) for pad in pads}
        self._set_up = None if any_device else LoggedSetUp(pads, identities_of(pads, eds))
        self.source = LogSource(path, pads, self._add, pace=None, channel=channel, any_device=True,
                                on_message=self._add_message, window=window)
        self._beginning = LogSource(path, pads, lambda pad, frame: None, pace=None, channel=channel, eds=eds,
                                    any_device=any_device,
                                    window=window._replace(duration=min(window.duration, CHECKED_TIME)))
        self._looked = 0.0  # stamp at which the bus state was last read [s]

    def check(self) -> None:
        """Raise LogError if the log cannot be read, or if its first seconds contradict the layout or the EDS."""
        self.source.open()
        self.source.close()
        self._beginning.play(threading.Event())

    def read(self, sink: Sink, stop_requested: threading.Event) -> None:
        """Read the whole log as fast as possible into ``sink``, or until ``stop_requested`` is set.

        Raises
        ------
        LogError
            Raised if the log cannot be read to its end, or if its CAN frames come from two buses.
        """
        self._sink = sink
        try:
            self.source.play(stop_requested)
        finally:
            self._add_facts()

    def _add(self, pad: str, frame: TaxelFrame) -> None:
        if pad not in self.contradictions:
            self._sink.add(pad, frame, *self._geometry[pad])

    def _add_message(self, message: can.Message) -> None:
        self._sink.add_message(message)
        if not 0 <= message.timestamp - self._looked < FACTS_PERIOD:
            self._looked = message.timestamp
            self._add_facts()
        if self._set_up is not None and non_data_kind(message) is None:
            found = self._set_up.feed(message.arbitration_id, bytes(message.data))
            if found is not None:
                self.contradictions.setdefault(found.pad, found)

    def _add_facts(self) -> None:
        self._sink.add_facts(self._looked, _shown(self.source.facts()))

    @property
    def unread(self) -> int:
        """Number of lines or parts that could not be read."""
        return self.source.facts().unread_log_lines

    @property
    def problem(self) -> str:
        """Reason why the last unread part could not be read."""
        return self.source.reader.problem

    @property
    def damages(self) -> tuple[Damage, ...]:
        """Damaged places in the log or in a series of logs."""
        return tuple(self.source.reader.damages)

    def strangers(self, pad: str) -> tuple[int, ...]:
        """Return the nodes that send a pad's COB-IDs, if the pad's own nodes were not heard."""
        return tuple(self.source.heard.strangers().get(pad, ()))

    @property
    def doubt(self) -> str:
        """Reason why the frames that were read may be wrong or missing, or ''."""
        found = [f'pad {pad} is not shown: node {other.node_id}, object 0x{other.object_index:04X} in the log is '
                 f'{other.got}, expected {other.expected}' for pad, other in self.contradictions.items()]
        found += [f'pad {pad}: node {", ".join(map(str, self.strangers(pad)))} sends its COB-IDs, not its own: check '
                  '--node-id' for pad in self.pads if self.strangers(pad)]
        if not found and not any(pad.published for pad in self.source.facts().pads):
            found = ['no taxel frame of these pads in the log: check --node-id']
        return '; '.join(found)


def _grasp_facts(message: Any) -> GraspFacts:
    return GraspFacts(_contact_name(int(message.contact)), bool(message.fresh), bool(message.stable),
                      acquired=-math.inf)


@cache
def _contact_name(code: int) -> str:
    name = name_of('msg/Grasp', 'contact', code).lower()
    return name if name.isidentifier() else 'not_known'  # a later version may have further codes


def _shown(facts: BusFacts) -> BusFacts:
    """Return the facts about a log without the unknown bus load, and without the many counts that no view shows."""
    return replace(facts, bus_load=math.nan,
                   pads=tuple(replace(pad, distinct_by_tpdo=(), fresh_by_tpdo=()) for pad in facts.pads))
