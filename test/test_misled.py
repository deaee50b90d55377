"""Nothing misleads a consumer that reads only the latest message. `make misled` prints its view, and for how long.

This file has the cases that need the whole chain. The parts of the other short cases are tested elsewhere: a frozen
skin with the planner, hidden rows and saturation in test_stages.py, and a tare of a grasp in test_driver_recovery.py.
"""

import pytest
from misled_bench import World, current, empty, is_overloaded
from misled_catalogue import SMALL, malformed_sent, object_creeps, rows_lost, unplugged
from misled_consumer import grasp_facts, shape_facts

from tactile_skin.msg import ContactShape, Grasp

pytestmark = [pytest.mark.ros, pytest.mark.bus]

PERIOD = 0.08  # Time between two frames [s], long enough for a busy machine.


@pytest.mark.parametrize(('message', 'facts'), [(Grasp(), grasp_facts), (ContactShape(), shape_facts)])
def test_a_default_constructed_message_claims_nothing(message, facts):
    claims = facts(message)
    assert not empty(claims) and not current(claims)


def check(findings):
    """Check that no forbidden claim is made, and that each temporary claim ends; `make misled` measures its time."""
    assert findings and not [finding for finding in findings if not finding.bound and finding.seconds]
    lasting = [finding for finding in findings if finding.bound and not finding.has_ended]
    if lasting and is_overloaded() and all(finding.claim == 'not stable' for finding in lasting):
        # A grasp that the machine cannot follow is rightly reported as not stable.
        pytest.skip('the machine does not keep up')
    assert not lasting


def test_a_consumer_is_not_misled_by_an_object_that_creeps():
    check(object_creeps(PERIOD))


@pytest.fixture(scope='module')
def world():
    with World(SMALL, period=PERIOD) as found:
        yield found


@pytest.mark.parametrize('case', [malformed_sent, rows_lost, unplugged], ids=lambda case: case.__name__)
def test_a_consumer_is_not_misled(world, case):
    """All cases use one world, in this order, because a failed bus stays failed."""
    world.skin.lose([])
    check(case(world))
