"""The age of a message over several stages whose clocks are not synchronised.

Each stage computes the age from one message alone, and the computed age is never too small.
"""

import math
from types import SimpleNamespace

import pytest
from builtin_interfaces.msg import Duration
from std_msgs.msg import Header

from tactile_node.ros.message_age import NOT_KNOWN_SEC, InputAge, age_message, age_seconds
from tactile_node.ros.time_messages import time_message

pytestmark = pytest.mark.ros

PERIOD, PATH = 0.02, 0.001
NOT_KNOWN = Duration(sec=NOT_KNOWN_SEC)
STAMP = 1_700_000_000.0


class Stage:
    """A stage that takes ``own`` [s] per message, and whose steady clock is ``offset`` [s] ahead of the true time."""

    def __init__(self, offset, own=0.005, lossless=False):
        self.now = 0.0
        self.own = own
        self.ages = InputAge(lossless=lossless, steady=lambda: self.now + offset)

    def pass_on(self, message, arrival):
        """Return the message as this stage sends it, and the time of sending."""
        self.now = arrival
        arrived = self.ages.arrived(message)
        self.now = arrival + self.own
        age = arrived.age(self.ages._steady())
        return SimpleNamespace(header=message.header, age=age_message(age)), self.now


def chain(stages, acquisitions, hold=lambda stage, sent: 0.0, offset=0.0, first_age=0.002):
    """Return (true time, true age, computed age) of each message when the last stage sends it.

    Each path delivers its messages in order.
    """
    results, last = [], [-math.inf] * len(stages)
    for acquired in acquisitions:
        message = SimpleNamespace(header=Header(stamp=time_message(STAMP + offset + acquired)),
                                  age=age_message(first_age))
        now = acquired + first_age
        for i, stage in enumerate(stages):
            now = max(now + PATH + hold(i, now), last[i])
            message, now = stage.pass_on(message, now)
            last[i] = now
        results.append((now, now - acquired, age_seconds(message.age)))
    return results


def stages(**options):
    return [Stage(offset, **options) for offset in (0.0, 5e5, -30.0)]


@pytest.mark.parametrize('offset', [0.0, -1e6, 3600.0])
def test_the_age_is_the_sum_over_all_stages_with_any_clocks(offset):
    results = chain(stages(), [PERIOD * i for i in range(200)], offset=offset)
    for now, true, age in results:
        assert age == math.inf if now < 1.5 else age == pytest.approx(true - 3 * PATH, abs=1e-3)
    assert results[100][2] < math.inf


@pytest.mark.parametrize('where', [0, 1, 2])
def test_ten_messages_held_back_before_any_stage_are_old_at_the_end(where):
    def hold(stage, sent):
        return max(0.0, 8.2 - sent) if stage == where and 3.0 <= sent < 3.2 else 0.0

    acquired = [PERIOD * i for i in range(150)] + [3.001 + PERIOD * i for i in range(9)] + [8.3 + PERIOD * i
                                                                                           for i in range(50)]
    results = chain(stages(), acquired, hold)
    burst = [age for _, true, age in results if true > 1.0]
    assert len(burst) == 9 and min(burst) > 4.9
    assert all(age < 0.1 for now, true, age in results if now > 1.6 and true < 1.0)


def test_an_age_that_is_not_known_stays_so():
    stage = Stage(0.0)
    for i in range(100):
        message = SimpleNamespace(header=Header(stamp=time_message(STAMP + PERIOD * i)), age=NOT_KNOWN)
        sent, _ = stage.pass_on(message, PERIOD * i)
        assert sent.age == NOT_KNOWN


def test_a_lossless_replay_measures_only_its_own_time():
    """Each message is held back until 9 s, and its age must not include this delay.

    The expected age is the age at the first stage plus the time spent in the stages.
    """
    results = chain(stages(lossless=True), [PERIOD * i for i in range(20)], hold=lambda i, sent: max(0.0, 9.0 - sent))
    assert [age for *_, age in results] == pytest.approx([0.002 + 3 * 0.005] * 20)


def test_ages_survive_as_messages():
    assert age_seconds(age_message(0.25)) == 0.25
    assert age_message(math.inf) == NOT_KNOWN and age_seconds(NOT_KNOWN) == math.inf
    assert age_message(1e30) == NOT_KNOWN
    assert age_seconds(Duration()) == 0.0
