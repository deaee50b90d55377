"""The rivals of the action PutDown in bench_put_down.py: a wrist sensor and a planner that feels nothing."""

import bench_put_down
import numpy as np
import pytest
from wrist_sensor import WRIST_RATE, WristRule

from tactile_node.gripper.rules.put_down import BASELINE_TIME
from tactile_node.shape.methods import make_recogniser
from training.ground_truth.seeds import Purpose, generator


def test_a_moving_average_detects_a_ramp_half_a_window_late():
    slope, met = 10.0, 3.0  # N/s, s
    times = np.arange(500) / WRIST_RATE
    rule = WristRule(window=0.2, threshold=2.0)
    found = times[rule.exceeded(slope * np.maximum(times - met, 0.0)).argmax()]
    assert found == pytest.approx(met + rule.threshold / slope + rule.window / 2, abs=1.5 / WRIST_RATE)


def test_the_tare_detects_nothing():
    exceeded = WristRule(window=0.1, threshold=1.0).exceeded(np.full(400, 5.0))
    assert exceeded.argmax() == BASELINE_TIME * WRIST_RATE


@pytest.mark.slow
def test_a_high_table_stops_each_arm_that_feels_it_and_is_pressed_by_a_blind_one(monkeypatch):
    monkeypatch.setattr(bench_put_down, 'tuned', lambda *_: WristRule(window=0.1, threshold=2.5))
    number, weight, speed, kind = max(bench_put_down.jobs('rivals'), key=_height)
    columns = bench_put_down.compared(make_recogniser(), number, weight, speed, kind)['columns']
    assert not any(column['above'] for column in columns.values())
    most = 2 * 5.0 * (weight + 0.5)  # the weight, and the friction of two pads that hold the object with 5 N
    assert columns['blind'] == {'opened': True, 'above': 0.0, 'pressed': pytest.approx(most)}
    assert columns['first']['opened'] and 2.0 < columns['first']['pressed'] < most
    assert columns['first']['pressed'] <= min(columns[name]['pressed'] for name in ('wrist 1 N', 'touch'))
    assert columns['example']['pressed'] == columns['touch']['pressed']


def _height(job):
    number, _, speed, _ = job
    rng = generator(Purpose.EVALUATION, bench_put_down.SEED + 50_000 + number)
    return speed > 0.002, rng.uniform(-0.03, 0.03)
