"""Evaluate our method and the anchors on the same cases."""

from collections.abc import Iterable
from typing import NamedTuple, Protocol

import numpy as np

from bench.recognition.cases import Case
from bench.recognition.figures import PercentRate, calibration_error
from tactile_node import ContactStream, Recogniser
from tactile_node.contact.pattern import ContactPattern
from tactile_node.shape.recogniser import OUTPUTS
from tactile_node.shape.recognition import Shape
from training.samples import UNKNOWN, Samples

ORDER = (*OUTPUTS, Shape.NONE)
OURS = 'ours'
LOSS = 0.02  #: Share of the known patterns that the score limit rejects.


class Anchor(Protocol):
    name: str

    def probabilities(self, samples: Samples) -> np.ndarray: ...


class Result(NamedTuple):
    """The probabilities from each contestant for a case, (K, 5 or more), beginning with the five classes."""

    case: Case
    answers: dict[str, np.ndarray]

    def right(self, name: str) -> np.ndarray:
        return self.answers[name].argmax(1) == self.case.labels

    def rate(self, name: str) -> PercentRate:
        right = self.right(name)
        return PercentRate(int(right.sum()), len(right))


class Contest:
    """Our method and the anchors. ``anchors`` maps True (on/off frames) and False (pressures) to [CNN, trees]."""

    def __init__(self, ours: Recogniser, anchors: dict[bool, list[Anchor]]):
        self.ours, self.anchors = ours, anchors

    def run(self, case: Case) -> Result:
        answers = {OURS: answers_of(self.ours, case.patterns)}
        for anchor in self.anchors[case.on_off]:
            answers[anchor.name] = anchor.probabilities(case.samples)
        return Result(case, answers)


def answers_of(recogniser: Recogniser, patterns: Iterable[ContactPattern]) -> np.ndarray:
    """Return the probabilities in the order of ORDER, as a (K, 7) array."""
    found = [recogniser.recognise(pattern).probabilities for pattern in patterns]
    return np.array([[probabilities[shape] for shape in ORDER] for probabilities in found])


def streamed(recogniser: Recogniser, stamps: np.ndarray, frames: Iterable[np.ndarray]) -> np.ndarray:
    """Return the shapes that the nodes report for successive on/off frames, as a (K, 7) array of zeros and ones."""
    stream = ContactStream(recogniser, unit='1')
    said = [stream.update(frame, stamp).fused.recognition.shape for stamp, frame in zip(stamps, frames)]
    return np.eye(len(ORDER))[[ORDER.index(shape) for shape in said]]


def calibration(results: list[Result], name: str) -> float:
    """Return the expected calibration error over all patterns of ``results``."""
    confidence = np.concatenate([result.answers[name].max(1) for result in results])
    return calibration_error(confidence, np.concatenate([result.right(name) for result in results]))


def foreign_score(result: Result, name: str) -> np.ndarray:
    """Return a score for each pattern, which is high if the contestant doubts that the pattern is a known shape."""
    answers = result.answers[name]
    return answers[:, UNKNOWN] + answers[:, UNKNOWN + 1:].sum(1) if name == OURS else 1 - answers.max(1)


def rejection_at_loss(known: list[Result], outliers: list[Result], name: str) -> PercentRate:
    """Return the rate of ``outliers`` rejected at the score limit that also rejects a share LOSS of ``known``."""
    limit = np.quantile(np.concatenate([foreign_score(result, name) for result in known]), 1 - LOSS)
    scores = np.concatenate([foreign_score(result, name) for result in outliers])
    return PercentRate(int((scores > limit).sum()), len(scores))
