"""What stands out in a report, as facts and as sentences; a support engineer reads these first."""

from collections.abc import Iterator, Mapping
from enum import Enum, unique
from types import MappingProxyType
from typing import NamedTuple

from tactile_node.cia301.emergency import Emergency
from tactile_node.cia301.objects import NmtState
from tactile_node.viewing.model import BusFacts, NodeFacts, PadFacts, Report, Reported
from tactile_node.viewing.status_record import Mark, marks_of

FULL = 0.9  #: of the bus's time; beyond, other traffic delays sweeps


@unique
class Finding(Enum):
    """The value is whether it is a problem; else it is a hint for the reader."""

    WRONG_DEVICE = 1, True        #: the log's SDO answers contradict layout or EDS: no taxel is given
    STRANGERS = 2, True           #: the taxels may be of other pads
    NO_TAXELS = 3, True           #: no taxel frame of the pad
    UNREAD = 4, True              #: parts of the file could not be read
    CLOCK_JUMPS = 5, True         #: the clock was set while recording
    LOST_CAN_FRAMES = 6, True
    LOST_FRAMES = 7, True         #: taxel frames, by their sequence
    INCOMPLETE = 8, True          #: taxel frames
    TAXEL_GAPS = 9, True
    BUS_GAPS = 10, False          #: a bus may rest
    EMERGENCIES = 11, True
    BOOTED_AGAIN = 12, True
    TWO_VALUES = 13, True         #: an identity that changed: two devices, one after the other
    FAULTY_TAXELS = 14, True      #: dead, stuck or flickering, by what they sent
    NODE_OF_NO_PAD = 15, False
    BUS_FULL = 16, True
    ERROR_FRAMES = 17, True
    LEFT_OUT = 18, False          #: touches beyond the most that are listed
    SEVERAL_BUSES = 20, True      #: what is reported of bus and nodes is of all of them
    REPORTED = 19, True           #: the driver reported that something is wrong

    @property
    def is_problem(self) -> bool:
        return bool(self.value[1])


class Found(NamedTuple):
    """``number``: how many, or for BUS_FULL the share; ``where``: the pad's name or the node-ID."""

    finding: Finding
    where: str = ''
    number: float = 0


def findings(report: Report) -> tuple[Found, ...]:
    """Return all, problems first."""
    recording = report.recording
    found = [Found(Finding.UNREAD, number=recording.unread), Found(Finding.CLOCK_JUMPS, number=recording.clock_jumps)]
    for pad in report.pads:
        found += _of_pad(pad)
    for node in report.nodes or ():
        found += _of_node(node)
    found += _of_bus(report.bus)
    return tuple(sorted((each for each in found if each.number), key=lambda each: not each.finding.is_problem))


def _of_pad(pad: PadFacts) -> Iterator[Found]:
    yield Found(Finding.WRONG_DEVICE, pad.name, pad.contradiction is not None)
    yield Found(Finding.STRANGERS, pad.name, len(pad.strangers))
    yield Found(Finding.NO_TAXELS, pad.name, not pad.are_of_others and (pad.frames == 0 or _is_empty(pad)))
    yield Found(Finding.LOST_CAN_FRAMES, pad.name, sum(count for _, count in pad.losses or ()))
    yield Found(Finding.LOST_FRAMES, pad.name, pad.lost_frames)
    yield Found(Finding.INCOMPLETE, pad.name, pad.incomplete)
    yield Found(Finding.TAXEL_GAPS, pad.name, pad.gap_count)
    if pad.health is not None:
        marks = marks_of(pad.health)
        yield Found(Finding.FAULTY_TAXELS, pad.name,
                    sum(int((marks == mark).sum()) for mark in (Mark.DEAD, Mark.STUCK, Mark.FLICKERING)))
    yield Found(Finding.LEFT_OUT, pad.name, pad.touches_left_out)


def _is_empty(pad: PadFacts) -> bool:
    """Without SYNC answers there are taxel frames all the same, of NaN."""
    return pad.statistics is not None and not pad.statistics.used


def _of_node(node: NodeFacts) -> Iterator[Found]:
    where = str(node.node_id)
    yield Found(Finding.EMERGENCIES, where, any(map(_is_error, node.emergencies)) and node.emergency_count or 0)
    yield Found(Finding.BOOTED_AGAIN, where, sum(change.state == NmtState.BOOT_UP for change in node.nmt[1:]))
    yield Found(Finding.TWO_VALUES, where, any(len(values) > 1 for values in node.identity.values()))
    yield Found(Finding.NODE_OF_NO_PAD, where, node.pad is None)


def _is_error(emergency: Emergency | Reported) -> bool:
    return emergency.is_problem if isinstance(emergency, Reported) else not emergency.is_reset


def _of_bus(bus: BusFacts) -> Iterator[Found]:
    yield Found(Finding.SEVERAL_BUSES, number=len(bus.channels) if len(bus.channels) > 1 else 0)
    yield Found(Finding.BUS_GAPS, number=bus.gap_count or 0)
    yield Found(Finding.ERROR_FRAMES, number=(bus.can_frames or {}).get('error', 0))
    yield Found(Finding.REPORTED, number=sum(each.is_problem for each in bus.reported or ()))
    if bus.load is not None and bus.load.shares is not None and bus.load.shares.max(initial=0.0) > FULL:
        yield Found(Finding.BUS_FULL, number=float(bus.load.shares.max()))


TEXTS: Mapping[Finding, str] = MappingProxyType({
    Finding.WRONG_DEVICE: 'Pad {where}: the SDO answers in the log are those of another device or another mapping than '
                          'layout and EDS have. Its taxels are left out; see the pad.',
    Finding.STRANGERS: 'Pad {where}: no heartbeat of its nodes, but those of {number:.0f} others that send the same '
                       'COB-IDs. The taxels may be of another pad. Check the node-IDs.',
    Finding.NO_TAXELS: 'Pad {where}: no taxels in this recording. Check --node-id and --layout, and whether SYNC was '
                       'sent.',
    Finding.UNREAD: '{number:.0f} lines, messages or rests of the file could not be read.',
    Finding.CLOCK_JUMPS: 'Times that the clock was set back while recording: {number:.0f}.',
    Finding.LOST_CAN_FRAMES: 'Pad {where}: {number:.0f} CAN frames are in no taxel frame; the pad has the reasons.',
    Finding.LOST_FRAMES: 'Pad {where}: {number:.0f} taxel frames are missing by their sequence numbers.',
    Finding.INCOMPLETE: 'Pad {where}: {number:.0f} taxel frames lack CAN frames.',
    Finding.TAXEL_GAPS: 'Pad {where}: gaps of half a second or longer without a taxel frame: {number:.0f}.',
    Finding.BUS_GAPS: 'Gaps of half a second or longer without any CAN frame: {number:.0f}.',
    Finding.EMERGENCIES: 'Node {where} sent {number:.0f} EMCYs, errors among them.',
    Finding.BOOTED_AGAIN: 'Node {where} started again within the recording; boot-ups: {number:.0f}.',
    Finding.TWO_VALUES: 'Node {where}: its identity changed. Two devices answered under this node-ID.',
    Finding.FAULTY_TAXELS: 'Pad {where}: {number:.0f} taxels are dead, stuck or flickering.',
    Finding.NODE_OF_NO_PAD: 'Node {where} was heard and belongs to no pad of this report. If it is a skin, give its '
                            '--node-id.',
    Finding.BUS_FULL: 'The bus was in use for {number:.0%} of a second, with bit stuffing at its worst.',
    Finding.ERROR_FRAMES: '{number:.0f} error frames of the CAN controller.',
    Finding.LEFT_OUT: 'Pad {where}: {number:.0f} more touches are not listed.',
    Finding.SEVERAL_BUSES: 'The recording has CAN frames of {number:.0f} buses. Load, gaps and nodes are of all of '
                           'them: choose one with --channel.',
    Finding.REPORTED: 'The driver reported warnings or errors: {number:.0f} changes; see the bus.'})


def sentence(found: Found) -> str:
    return TEXTS[found.finding].format(where=found.where, number=found.number)
