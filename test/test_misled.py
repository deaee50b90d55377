"""Nothing misleads a consumer that reads the latest message only; `make misled` prints what it sees, and for how long.

Here are the cases that need the whole chain. Of the other short ones the parts are tested: a frozen skin with the
planner, hidden rows and saturation in test_stages.py, a tare of a grasp in test_driver_recovery.py.
"""

import pytest
from misled_bench import World, current, empty, is_overloaded
from misled_catalogue import SMALL, malformed_sent, object_creeps, rows_lost, unplugged
from misled_consumer import grasp_facts, shape_facts

from tactile_skin.msg import ContactShape, Grasp

pytestmark = [pytest.mark.ros, pytest.mark.bus]

PERIOD = 0.08  # s between two frames: a busy machine keeps up


@pytest.mark.parametrize(('message', 'facts'), [(Grasp(), grasp_facts), (ContactShape(), shape_facts)])
def test_a_default_constructed_message_claims_nothing(message, facts):
    claims = facts(message)
    assert not empty(claims) and not current(claims)


def check(findings):
    """What may never be claimed is not claimed, and what may be claimed for some time ends; `make misled` times it."""
    assert findings and not [finding for finding in findings if not finding.bound and finding.seconds]
    lasting = [finding for finding in findings if finding.bound and not finding.has_ended]
    if lasting and is_overloaded() and all(finding.claim == 'not stable' for finding in lasting):
        pytest.skip('the machine does not keep up')  # what it does not keep up with is not stable, rightly
    assert not lasting


def test_a_consumer_is_not_misled_by_an_object_that_creeps():
    check(object_creeps(PERIOD))


@pytest.fixture(scope='module')
def world():
    with World(SMALL, period=PERIOD) as found:
        yield found


@pytest.mark.parametrize('case', [malformed_sent, rows_lost, unplugged], ids=lambda case: case.__name__)
def test_a_consumer_is_not_misled(world, case):
    """One world for all, in this order: a bus that has failed stays so."""
    world.skin.lose([])
    check(case(world))
