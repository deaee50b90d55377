"""The sentences of the findings; the only place."""

from collections.abc import Mapping
from types import MappingProxyType

from tactile_node.report.findings import Finding, Found

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
