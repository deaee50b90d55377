"""If the pressed taxels have not changed since the previous frame, the previous result is used again.

The tests also cover the cases in which the result must be computed again.
"""

import numpy as np
import pytest

from tactile_node.pose.pipeline import ContactPipeline, Taxels
from tactile_node.shape.fusion import FusionSettings
from tactile_node.shape.methods import VisibilityGuard
from tactile_node.shape.recognition import Recognition, Shape

TAXELS = Taxels(pitch=0.002, unit='Pa')
PERIOD = 0.02  # Time between two frames [s].


class Asked:
    """A recognition method that returns ``shape`` with ``confidence`` and counts its calls."""

    classes = tuple(Shape)

    def __init__(self, shape=Shape.SQUARE, confidence=0.95):
        self.shape, self.confidence, self.count = shape, confidence, 0

    def recognise_all(self, patterns):
        self.count += len(patterns)
        return [Recognition.of({self.shape: self.confidence, Shape.UNKNOWN: 1 - self.confidence})] * len(patterns)


def pressed(rows=slice(4, 11), cols=slice(4, 11), level=50e3):
    values = np.zeros((16, 16))
    values[rows, cols] = level
    return values


def asked_of(frames, method, stamps=None, **options):
    """Return one boolean per frame, which is True if the method was called."""
    pipeline = ContactPipeline(VisibilityGuard(method), **options)
    stamps = PERIOD * np.arange(len(frames)) if stamps is None else stamps
    asked = []
    for frame, stamp in zip(frames, stamps):
        before = method.count
        pipeline.follow(frame, TAXELS, float(stamp))
        asked.append(method.count > before)
    return asked


@pytest.mark.parametrize('confidence', [0.95, 0.6])
def test_the_same_taxels_are_recognised_again_after_80_ms(confidence):
    frames = [pressed(level=50e3 + 100 * n) for n in range(9)]
    asked = asked_of(frames, Asked(confidence=confidence), stamps=0.025 * np.arange(9))
    assert asked == [True, False, False, False] * 2 + [True]


@pytest.mark.parametrize('frame', [
    pytest.param(pressed(cols=slice(4, 12)), id='larger'),
    pytest.param(pressed(cols=slice(5, 12)), id='moved'),
    pytest.param(np.zeros((16, 16)), id='released'),
    pytest.param(np.where(np.arange(16) == 2, np.nan, pressed()), id='a column is hidden'),
    pytest.param(pressed()[:14], id='another pad'),
    pytest.param(np.maximum(pressed(), pressed(slice(13, 16), slice(0, 3))), id='a second contact')])
def test_a_frame_that_differs_in_one_taxel_is_recognised_at_once(frame):
    assert asked_of([pressed(), pressed(), frame], Asked(), stamps=[0.0, 0.001, 0.002]) == [True, False, True]


def test_each_frame_is_answered_alone_without_fusion_and_after_a_gap_or_a_stamp_that_goes_back():
    assert asked_of([pressed()] * 4, Asked(), fusion=None) == [True] * 4
    assert asked_of([pressed()] * 3, Asked(), stamps=[1.0, 2.0, 1.5]) == [True] * 3


@pytest.mark.parametrize('fusion', [FusionSettings(), None])
def test_another_object_in_the_same_place_is_recognised_after_a_restart(fusion):
    method = Asked()
    pipeline = ContactPipeline(VisibilityGuard(method), fusion=fusion)
    pipeline.follow(pressed(), TAXELS, 0.0)
    pipeline.restart()
    method.shape = Shape.CIRCLE
    assert pipeline.follow(pressed(), TAXELS, 0.001).fused.recognition.shape is Shape.CIRCLE
