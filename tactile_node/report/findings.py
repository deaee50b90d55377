"""What stands out in a report, as facts; a support engineer reads these first."""

from collections.abc import Iterator
from enum import Enum, unique
from typing import NamedTuple

from tactile_node.cia301.emergency import Emergency
from tactile_node.cia301.nmt import NmtState
from tactile_node.report.model import BusFacts, NodeFacts, PadFacts, Report, Reported
from tactile_node.report.taxel_marks import Mark, marks_of

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
