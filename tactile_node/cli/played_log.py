"""Play a CAN log to its end without ROS, for `tactile replay` and `tactile calibrate`."""

import sys
from pathlib import Path
from typing import NamedTuple

from tactile_node.cli.progress import count_progress
from tactile_node.errors import InputError
from tactile_node.interruption import interruption
from tactile_node.logs.damage import damage_lines
from tactile_node.logs.replay_times import WHOLE, TimeWindow
from tactile_node.skin.pads import PadSettings
from tactile_node.sources.log_source import LogSource
from tactile_node.taxel_frame import TaxelFrame

UNUSABLE_REMEDY = ('`tactile replay` counts the reasons. Compare "map" in the layout with 0x1A00... of the device, and '
                   'check that the log contains SYNC.')


class PlayedLog(NamedTuple):
    """Result of playing a CAN log."""

    frames: dict[str, list[TaxelFrame]]  #: taxel frames by pad name, or empty if the frames were not kept
    source: LogSource                    #: the closed source, whose facts and summary can still be read
    has_ended: bool                      #: False if the user interrupted the replay

    @property
    def unused(self) -> list[InputError]:
        """One error for each pad for which the log contains no usable TPDO."""
        return [InputError(f'log, pad {pad.pad!r}', expected='TPDOs with taxels',
                           got=f'{pad.tpdos_received} TPDOs, none of which can be used' if pad.tpdos_received
                           else 'no TPDO',
                           remedy=UNUSABLE_REMEDY if pad.tpdos_received else 'Check --node-id and --layout.')
                for pad in self.source.facts().pads if not pad.tpdos_used]


def play_log(path: str, pads: tuple[PadSettings, ...], *, channel: str = '', any_device: bool = False,
             window: TimeWindow = WHOLE, keep: bool = True, must_be_used: bool = False) -> PlayedLog:
    """Play a CAN log as fast as possible, and report unreadable parts on stderr.

    Parameters
    ----------
    path
        Path of the log.
    pads
        Pads whose taxel frames are assembled.
    channel
        Bus to play if the log contains several buses, as named in the log.
    any_device
        True to play the log even if its SDO transfers show another device or another TPDO mapping.
    window
        Part of the log to play.
    keep
        True to keep the taxel frames, or False to only count the frames, which needs constant memory.
    must_be_used
        True to raise an error if the user interrupts the replay or a pad has no usable TPDO.

    Raises
    ------
    LogError
        Raised if the log cannot be played to the end.
    KeyboardInterrupt
        Raised if ``must_be_used`` is set and the user interrupts the replay.
    InputError
        Raised if ``must_be_used`` is set and a pad has no usable TPDO in the log.
    """
    frames: dict[str, list[TaxelFrame]] = {pad.name: [] for pad in pads}
    with interruption() as stop_requested, count_progress(Path(path).name, ' frames') as bar:
        def on_frame(name: str, frame: TaxelFrame) -> None:
            bar.update()
            if keep:
                frames[name].append(frame)

        source = LogSource(path, pads, on_frame, pace=None, channel=channel, any_device=any_device, window=window)
        source.play(stop_requested)
    for line in damage_lines(source.reader.damages):
        print(line, file=sys.stderr)
    if source.facts().unread_log_lines:
        print(f'{path}: {source.reader.summary}', file=sys.stderr)
    played = PlayedLog(frames, source, source.finished.is_set())
    if must_be_used and not played.has_ended:
        raise KeyboardInterrupt
    if must_be_used and (unused := played.unused):
        raise unused[0]
    return played
