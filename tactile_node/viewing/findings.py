"""Findings of a report, each with its data and a sentence. A support engineer reads the findings first."""

from collections.abc import Iterator
from enum import Enum, unique
from typing import NamedTuple

import numpy as np

from tactile_node.assembly.facts import losses_in
from tactile_node.viewing.model import BusReport, NodeReport, PadReport, Report
from tactile_node.viewing.taxel_record import FAULTS, marks_of

HIGH_LOAD = 0.9  #: bus load above which other traffic delays sweeps, as a fraction


@unique
class Remark(Enum):
    """Kinds of findings. Each value holds True for a problem or False for a hint, and the sentence to show."""

    WRONG_DEVICE = True, ('Pad {where}: the SDO responses in the log show a different device or mapping than the '
                          'layout {layout} and its EDS. The page omits the taxels; see the section of this pad. Name '
                          'the layout of the recorded device with --layout, and replace the page with --force.')
    STRANGERS = True, ('Pad {where}: the nodes of this pad sent no heartbeat, but {number:.0f} other nodes with the '
                       'same COB-IDs did. The taxels may belong to another pad. Check the node-IDs.')
    NO_TAXELS = True, ('Pad {where}: this recording contains no taxels. Check --node-id and --layout, and check that '
                       'SYNC was sent.')
    UNREAD = True, '{number:.0f} lines, messages or parts of the file could not be read.'
    CLOCK_JUMPS = True, 'The clock was set back {number:.0f} times during the recording.'
    LOST_CAN_FRAMES = True, ('Pad {where}: {number:.0f} CAN frames were not used for any taxel frame. The section of '
                             'this pad lists the reasons.')
    LOST_FRAMES = True, 'Pad {where}: according to the sequence numbers, {number:.0f} taxel frames are missing.'
    INCOMPLETE = True, 'Pad {where}: {number:.0f} taxel frames lack CAN frames.'
    TAXEL_GAPS = True, 'Pad {where}: gaps of half a second or longer without a taxel frame: {number:.0f}.'
    # an idle bus is not a problem
    BUS_GAPS = False, 'Gaps of half a second or longer without any CAN frame: {number:.0f}.'
    EMERGENCIES = True, 'Node {where} sent {number:.0f} EMCYs, at least one of which reports an error.'
    BOOTED_AGAIN = True, 'Node {where} restarted during the recording; number of boot-ups: {number:.0f}.'
    TWO_VALUES = True, 'Node {where}: the identity changed, so two devices answered with this node-ID.'
    FAULTY_TAXELS = True, 'Pad {where}: {number:.0f} taxels are dead, stuck or flickering.'
    NODE_OF_NO_PAD = False, ('Node {where} was heard but does not belong to any pad in this report. If the node is a '
                             'skin, add its node-ID to --node-id.')
    BUS_FULL = True, 'The highest bus load was {number:.0%}, assuming worst-case bit stuffing.'
    ERROR_FRAMES = True, ('The CAN log contains {number:.0f} error frames. With slcan, an error frame is a damaged '
                          'line of the serial port.')
    LEFT_OUT = False, 'Pad {where}: {number:.0f} more touches are not listed.'
    SEVERAL_BUSES = True, ('The recording has CAN frames from {number:.0f} buses. Load, gaps and nodes cover all of '
                           'them; choose one with --channel.')
    REPORTED = True, 'The driver reported {number:.0f} changes to a warning or an error; see the section "Bus".'

    @property
    def is_problem(self) -> bool:
        return self.value[0]


class Found(NamedTuple):
    """A finding. ``number`` is a count (for BUS_FULL, a fraction), and ``where`` is a pad name or a node-ID."""

    finding: Remark
    where: str = ''
    number: float = 0
    layout: str = ''  #: name of the pad's layout, for WRONG_DEVICE

    @property
    def sentence(self) -> str:
        text: str = self.finding.value[1]
        return text.format(where=self.where, number=self.number, layout=self.layout)


def findings(report: Report) -> tuple[Found, ...]:
    """Return all findings in a report, problems first."""
    recording = report.recording
    found = [Found(Remark.UNREAD, number=recording.unread), Found(Remark.CLOCK_JUMPS, number=recording.clock_jumps)]
    for pad in report.pads:
        found += _of_pad(pad)
    for node in report.nodes or ():
        found += _of_node(node)
    found += _of_bus(report.bus)
    return tuple(sorted((each for each in found if each.number), key=lambda each: not each.finding.is_problem))


def _of_pad(pad: PadReport) -> Iterator[Found]:
    yield Found(Remark.WRONG_DEVICE, pad.name, pad.contradiction is not None, pad.layout or '')
    yield Found(Remark.STRANGERS, pad.name, len(pad.strangers))
    yield Found(Remark.NO_TAXELS, pad.name, not pad.are_of_others and (pad.frames == 0 or _is_empty(pad)))
    yield Found(Remark.LOST_CAN_FRAMES, pad.name, 0 if pad.counts is None else sum(losses_in(pad.counts).values()))
    yield Found(Remark.LOST_FRAMES, pad.name, pad.lost_frames)
    yield Found(Remark.INCOMPLETE, pad.name, pad.incomplete)
    yield Found(Remark.TAXEL_GAPS, pad.name, pad.gaps.count)
    if pad.health is not None:
        yield Found(Remark.FAULTY_TAXELS, pad.name, int(np.isin(marks_of(pad.health), FAULTS).sum()))
    yield Found(Remark.LEFT_OUT, pad.name, pad.touches.left_out)


def _is_empty(pad: PadReport) -> bool:
    """Return True if no TPDO was used. If no node responds to SYNC, the taxel frames contain only NaN."""
    return pad.counts is not None and pad.counts['tpdos_expected'] > 0 and not pad.counts['tpdos_used']


def _of_node(node: NodeReport) -> Iterator[Found]:
    where = str(node.node_id)
    yield Found(Remark.EMERGENCIES, where, any(each.is_problem for each in node.emergencies) and node.emergencies.count)
    yield Found(Remark.BOOTED_AGAIN, where, node.restarts)
    yield Found(Remark.TWO_VALUES, where, any(len(values) > 1 for values in node.identity.values()))
    yield Found(Remark.NODE_OF_NO_PAD, where, node.pad is None)


def _of_bus(bus: BusReport) -> Iterator[Found]:
    yield Found(Remark.SEVERAL_BUSES, number=len(bus.channels) if len(bus.channels) > 1 else 0)
    yield Found(Remark.BUS_GAPS, number=bus.gaps.count if bus.gaps is not None else 0)
    yield Found(Remark.ERROR_FRAMES, number=(bus.can_frames or {}).get('error', 0))
    yield Found(Remark.REPORTED, number=sum(each.is_problem for each in bus.reported or ()))
    if bus.load is not None and bus.load.shares is not None and bus.load.shares.max(initial=0.0) > HIGH_LOAD:
        yield Found(Remark.BUS_FULL, number=float(bus.load.shares.max()))
