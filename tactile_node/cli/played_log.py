"""A CAN log, played to its end without ROS: what `replay` and `calibrate` share."""

import sys
from pathlib import Path
from typing import NamedTuple

from tactile_node.cli.progress import count_progress
from tactile_node.errors import InputError, LogError
from tactile_node.interruption import interruption
from tactile_node.logs.damage import damage_lines
from tactile_node.logs.replay_times import WHOLE, TimeWindow
from tactile_node.skin.pads import PadSettings
from tactile_node.sources.log_source import LogSource
from tactile_node.taxel_frame import TaxelFrame

UNUSABLE_REMEDY = ('`tactile replay` counts the reasons. Compare "map" of the layout with 0x1A00... of the device, and '
                   'check that the log has SYNC.')


class PlayedLog(NamedTuple):
    """What a log held."""

    frames: dict[str, list[TaxelFrame]]  #: by the pad's name; empty where they were not kept
    source: LogSource                    #: closed: its statistics and summary
    has_ended: bool                      #: False: interrupted

    @property
    def unused(self) -> list[InputError]:
        """An error for each pad that has no taxels in the log: none of its TPDOs is there, or none can be used."""
        return [InputError(f'log, pad {name!r}', expected='TPDOs with taxels',
                           got=f'{pad.received} TPDOs, none of which can be used' if pad.received else 'no TPDO',
                           remedy=UNUSABLE_REMEDY if pad.received else 'Check --node-id and --layout.')
                for name, pad in self.source.statistics().pads.items() if not pad.used]


def play_log(path: str, pads: tuple[PadSettings, ...], *, pace: float | None = None, channel: str = '',
             any_device: bool = False, window: TimeWindow = WHOLE, keep: bool = True,
             must_be_used: bool = False) -> PlayedLog:
    """Play ``window`` of ``path`` at ``pace`` (None: as fast as possible); what cannot be read is reported on stderr.

    Not ``keep``: the frames are only counted, and memory stays flat. Raises LogError where it cannot be played to its
    end; with ``must_be_used`` also KeyboardInterrupt where that was interrupted, InputError for a pad without a TPDO.
    """
    frames: dict[str, list[TaxelFrame]] = {pad.name: [] for pad in pads}
    count = 0

    def on_frame(name: str, frame: TaxelFrame) -> None:
        nonlocal count
        count += 1
        if keep:
            frames[name].append(frame)

    source = LogSource(path, pads, on_frame, pace=pace, channel=channel, any_device=any_device, window=window)
    with interruption() as stop_requested, count_progress(Path(path).name, ' frames') as bar:
        source.open()
        source.start()
        while not source.finished.wait(0.1) and not stop_requested.is_set():
            bar.update(count - bar.n)
        source.close()
    if source.failure:
        raise LogError(path, expected='a log to its end', got=source.failure.detail.removesuffix('.'),
                       remedy='What was played up to there is not used.')
    for line in damage_lines(source.reader.damages):
        print(line, file=sys.stderr)
    if source.statistics().unread:
        print(f'{path}: {source.reader.summary}', file=sys.stderr)
    played = PlayedLog(frames, source, source.finished.is_set())
    if must_be_used and not played.has_ended:
        raise KeyboardInterrupt
    if must_be_used and (unused := played.unused):
        raise unused[0]
    return played
