"""Nothing misleads a consumer that reads the latest message only; `make misled` prints what it sees, and for how long.

Here are the cases that need the whole chain. Of the other short ones the parts are tested: a frozen skin with the
planner, hidden rows and saturation in test_stages.py, a tare of a grasp in test_driver_recovery.py.
"""

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')

from misled_bench import current, empty  # noqa: E402
from misled_catalogue import bus_fails, malformed_messages, object_creeps, rows_are_hidden  # noqa: E402
from misled_consumer import grasp_facts, shape_facts  # noqa: E402

from tactile_skin.msg import ContactShape, Grasp  # noqa: E402

pytestmark = [pytest.mark.ros, pytest.mark.bus]


@pytest.mark.parametrize('case', [bus_fails, malformed_messages, object_creeps, rows_are_hidden],
                         ids=lambda case: case.__name__)
def test_a_consumer_is_not_misled(case):
    """What may never be claimed is not claimed, and what may be claimed for some time ends; `make misled` times it."""
    findings = case()
    assert findings and not [finding for finding in findings if not finding.bound and finding.seconds]
    assert not [finding for finding in findings if finding.bound and not finding.has_ended]


@pytest.mark.parametrize(('message', 'facts'), [(Grasp(), grasp_facts), (ContactShape(), shape_facts)])
def test_a_default_constructed_message_claims_nothing(message, facts):
    claims = facts(message)
    assert not empty(claims) and not current(claims)
