"""docs/hardware.md and the table of counters explain what the driver can report, and nothing else."""

import re
import sys
from pathlib import Path

import pytest

from tactile_node.assembly.frame_source import BusStatistics, LossReason, PadStatistics
from tactile_node.assembly.health import BusFault, BusHealth, NodeFault, NodeHealth, Overload, SyncFault
from tactile_node.cia301.objects import SERVICES, NmtState
from tactile_node.conditioning.conditioned_pad import PadCondition
from tactile_node.conditioning.taxel_faults import FaultDetector
from tactile_node.ros.diagnostics import BusDiagnostics

DOCS = Path(__file__).resolve().parents[1] / 'docs'
sys.path.insert(0, str(DOCS / '_ext'))
from from_code import counters  # noqa: E402

pytestmark = pytest.mark.ros

PAGE = (DOCS / 'hardware.md').read_text(encoding='utf-8')


def reported() -> set[str]:
    """Every key on /diagnostics."""
    pad = PadStatistics(complete=0, incomplete=0, expected=0, received=0, used=0, pending=0,
                        losses=dict.fromkeys(LossReason, 0))
    services = {service.use for service in SERVICES} | {'tpdo', 'sync', 'foreign', 'remote'}
    counts = BusStatistics({'pad': pad}, dict.fromkeys(services, 0))
    health = BusHealth(nodes={'pad': (NodeHealth(32, NmtState.STOPPED, False, None),)})
    condition = PadCondition(FaultDetector(1, 1, 1.0).faults)
    statuses = BusDiagnostics('driver', 'can0').message(counts, health, {'pad': condition}).status
    return {pair.key for status in statuses for pair in status.values}


def explained() -> set[str]:
    pages = [PAGE.split('## What a diagnostic means')[1].split('### Faults of the bus')[0], counters.markdown()]
    cells = [line.split('|')[1] for page in pages for line in page.splitlines() if line.startswith('| `')]
    names = [name for cell in cells for name in re.findall(r'`(\w+)`', cell)]
    return {f'can_frames{name}' if name.startswith('_') else name for name in names}


def test_every_value_is_explained_and_no_other():
    assert explained() == reported()


@pytest.mark.parametrize('fault', [fault for fault in (*NodeFault, *BusFault, *SyncFault, *Overload) if fault.is_fault])
def test_every_fault_is_explained_with_its_name_and_sentence(fault):
    assert f'| `{fault.name}` | {fault.phrase} |' in PAGE
