"""Nothing misleads a consumer that reads the latest message only; `make misled` prints what it sees."""

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')

from misled_bench import current, empty  # noqa: E402
from misled_catalogue import SHORT  # noqa: E402
from misled_consumer import grasp_facts, shape_facts  # noqa: E402

from tactile_skin.msg import ContactShape, Grasp  # noqa: E402

pytestmark = [pytest.mark.ros, pytest.mark.bus]


ATTEMPTS = 3  # at what has a time to it: a busy machine loses frames. What may never be claimed has one


@pytest.mark.parametrize('case', SHORT, ids=lambda case: case.__name__)
def test_a_consumer_is_not_misled(case):
    for _ in range(ATTEMPTS):
        findings = case()
        wrong = [finding for finding in findings if not finding.holds]
        assert findings and not [finding for finding in wrong if finding.misleads and not finding.bound]
        if not wrong:
            return
    pytest.fail(f'for too long: {wrong}')


@pytest.mark.parametrize(('message', 'facts'), [(Grasp(), grasp_facts), (ContactShape(), shape_facts)])
def test_a_default_constructed_message_claims_nothing(message, facts):
    claims = facts(message)
    assert not empty(claims) and not current(claims)
