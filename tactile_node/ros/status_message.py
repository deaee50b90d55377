"""State and counts of the driver as a SkinStatus message, with the same levels as on /diagnostics."""

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum
from types import MappingProxyType
from typing import Any

from lifecycle_msgs.msg import State
from std_msgs.msg import Header

from tactile_node.assembly.facts import BusFacts, NodeFacts, PadFacts
from tactile_node.assembly.health import Fault
from tactile_node.cia301.objects import NmtState
from tactile_node.conditioning.conditioned_pad import PadCondition
from tactile_node.conditioning.tared_pad import ZeroState
from tactile_node.conditioning.taxel_faults import FaultyTaxels, TaxelFault
from tactile_node.ros.diagnostics import Finding, worst_level
from tactile_skin.msg import FaultyTaxel, NodeStatus, PadStatus, SkinStatus

#: NMT state -> its number in NodeStatus.msg; None is the state of a node that was never heard from
NMT_NUMBERS: Mapping[int | None, int] = {None: NodeStatus.NMT_NOT_KNOWN, NmtState.BOOT_UP: NodeStatus.NMT_BOOT_UP,
               NmtState.STOPPED: NodeStatus.NMT_STOPPED, NmtState.OPERATIONAL: NodeStatus.NMT_OPERATIONAL,
               NmtState.PRE_OPERATIONAL: NodeStatus.NMT_PRE_OPERATIONAL}


class PrimaryState(IntEnum):
    """Primary states of a lifecycle node, with the codes of lifecycle_msgs/State and of SkinStatus."""

    NOT_KNOWN = State.PRIMARY_STATE_UNKNOWN
    UNCONFIGURED = State.PRIMARY_STATE_UNCONFIGURED
    INACTIVE = State.PRIMARY_STATE_INACTIVE
    ACTIVE = State.PRIMARY_STATE_ACTIVE
    FINALIZED = State.PRIMARY_STATE_FINALIZED


def status_message(findings: Sequence[Finding], facts: BusFacts,
                   conditions: Mapping[str, PadCondition] = MappingProxyType({}),
                   lifecycle: PrimaryState = PrimaryState.NOT_KNOWN) -> SkinStatus:
    """Return the status of the driver as a message without a stamp.

    Parameters
    ----------
    findings
        Findings of `BusDiagnostics.evaluate` for the same facts.
    facts
        Facts about the bus, its pads and their nodes.
    conditions
        Condition of the taxels, by pad name.
    lifecycle
        Lifecycle state of the driver.
    """
    bus, *pads = findings
    return _filled(SkinStatus, facts, header=Header(), level=_level(worst_level(findings)), message=bus.message,
                   lifecycle_state=lifecycle,
                   pads=[_pad(finding, pad, conditions.get(pad.pad)) for finding, pad in zip(pads, facts.pads)])


def _filled(kind: Any, facts: BusFacts | PadFacts | NodeFacts, **others: Any) -> Any:
    """Return a message whose fields are filled with the facts of the same name, except for the ``others``."""
    for name, type_ in kind.get_fields_and_field_types().items():
        if name not in others:
            value = getattr(facts, name)
            code = value.value if isinstance(value, Fault) else value
            others[name] = str(value or '') if type_ == 'string' else code
    return kind(**others)


def _level(level: bytes) -> int:
    """Return the level as a SkinStatus number; these begin at 1, because 0 is the default of a message field."""
    return level[0] + 1


def _pad(finding: Finding, pad: PadFacts, condition: PadCondition | None) -> PadStatus:
    return _filled(PadStatus, pad, level=_level(finding.level), message=finding.message,
                   nodes=[_filled(NodeStatus, node, nmt_state=NMT_NUMBERS.get(node.state, NodeStatus.NMT_UNDEFINED))
                          for node in pad.nodes],
                   faulty_taxels=_faulty(condition.faults) if condition else [],
                   unchanged=condition.unchanged if condition else math.nan,
                   zero_state=(condition.zero if condition else ZeroState.NOT_KNOWN).value)


def _faulty(faults: FaultyTaxels) -> list[FaultyTaxel]:
    return [FaultyTaxel(row=row, col=col, code=kind.value, fault=kind.name.lower())
            for kind in TaxelFault if kind for row, col in faults.places(kind)]
