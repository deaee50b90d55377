"""Tests that a recording has hand-made labels for all of its frames or for none."""

from functools import cache

import numpy as np
import pytest

from bench.recognition import cases
from bench.recognition.cases import frame_labels

recorded = cache(cases.recorded)


@pytest.mark.slow
@pytest.mark.parametrize('recording', ['nus_ring_session', 'nus_square_excerpt', 'nus_square_moving'])
def test_labels_cover_all_frames_of_the_log(recording):
    stamps, _ = recorded(recording)
    assert len(frame_labels(recording)) == len(stamps)


def test_labels_and_frames_of_the_excerpt_are_those_of_the_recording_it_is_from():
    assert (frame_labels('nus_square_excerpt') == frame_labels('nus_square_moving')[1:201]).all()
    (stamps, log), (polls, events) = recorded('nus_square_excerpt'), recorded('nus_square_moving')
    np.testing.assert_array_equal(log, events[1:201])
    np.testing.assert_allclose(stamps - stamps[0], polls[1:201] - polls[1], atol=1e-5)


@pytest.mark.parametrize('rows', ['1,4,object', '0,4,object\n4,5,not', '0,4,object\n6,7,not', '0,4,held', '3,2,not'])
def test_ranges_with_a_hole_an_overlap_or_an_unknown_label_are_refused(rows, tmp_path, monkeypatch):
    (tmp_path / 'log.csv').write_text(f'# by hand\nfirst_frame,last_frame,label\n{rows}\n', encoding='utf-8')
    monkeypatch.setattr(cases, 'BY_HAND', tmp_path)
    with pytest.raises(ValueError, match='log'):
        frame_labels('log')
