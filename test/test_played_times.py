"""The age of a replayed frame counts from its playback, whatever its stamp and the playback speed."""

import pytest

from tactile_node.logs.replay_times import MOST_ENTRIES, PLAYED_RESOLUTION, PlayedTimes


class Played:
    """Stamps of a log that is played with a clock controlled by the test."""

    def __init__(self):
        self.now = 50.0
        self.times = PlayedTimes(lambda: self.now)

    def age(self, stamp):
        return self.now - self.times.time_of(stamp)

    def play(self, *stamps, each):
        for stamp in stamps:
            self.times.note(stamp)
            self.now += each


@pytest.mark.parametrize('pace', [1.0, 5.0])
def test_the_age_is_since_the_stamp_was_played(pace):
    log = Played()
    log.play(*(1000 + 0.02 * n for n in range(100)), each=0.02 / pace)
    assert log.age(1000 + 0.02 * 99) == pytest.approx(0.02 / pace)
    assert log.age(1000 + 0.02 * 95) == pytest.approx(0.1 / pace)


def test_a_pause_is_in_the_age():
    log = Played()
    log.play(1000.0, 1000.02, each=0.02)
    log.now += 30
    log.play(1000.04, each=0.02)
    assert log.age(1000.02) == pytest.approx(30.04) and log.age(1000.04) == pytest.approx(0.02)


def test_stamps_played_at_once_share_an_entry():
    log = Played()
    log.play(*(1000 + 0.001 * n for n in range(10_000)), each=1e-6)
    assert len(log.times._entries) <= 10_000 * 1e-6 / PLAYED_RESOLUTION + 1
    assert log.age(1000 + 0.001 * 9_999) == pytest.approx(0, abs=1.1 * PLAYED_RESOLUTION)


def test_a_stamp_played_long_ago_is_at_least_as_old_as_the_first_entry():
    log = Played()
    log.play(*(1000 + 0.02 * n for n in range(2 * MOST_ENTRIES)), each=0.002)
    assert log.age(1000.0) >= MOST_ENTRIES * 0.002 - 0.01
    assert Played().age(1.0) == 0.0
