"""Make the tables of clean frames, field conditions and recordings."""

import numpy as np

from bench.recognition.cases import FRAME_LABELS, frame_labels, patches, recorded
from bench.recognition.contest import ORDER, OURS, Contest, Result, answers_of, calibration, streamed
from bench.recognition.figures import PercentRate
from bench.recognition.page import KIND, Table
from tactile_node import Recogniser
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.shape.recognition import Shape

#: Recordings with the shape of the object in each.
RECORDED = {'nus_ring_session': Shape.CIRCLE, 'nus_square_moving': Shape.SQUARE}


def rates(heading: str, text: str, results: list[Result]) -> Table:
    names = list(results[0].answers)
    table = Table(heading, text, ['condition', 'frames', 'area', 'patterns', *(f'{name}, %' for name in names),
                                  'ours unknown, %', 'ours against the better'])
    for result in results:
        table.add(result.case.condition, KIND[result.case.on_off], f'{result.case.area:g}', result.rate(OURS).total,
                  *(result.rate(name) for name in names), f'{100 * unknown(result).value:.2f}', _verdict(result))
    return table


def _verdict(result: Result) -> str:
    anchors = [result.rate(name) for name in result.answers if name != OURS]
    if not anchors:
        return ''
    low, high = max(anchors, key=lambda rate: rate.value).interval
    ours = result.rate(OURS).value
    return 'above' if ours > high else 'within' if ours >= low else 'BELOW'


def unknown(result: Result) -> PercentRate:
    """Return the rate of known shapes that our method calls unknown."""
    called = result.answers[OURS].argmax(1) == ORDER.index(Shape.UNKNOWN)
    return PercentRate(int(called.sum()), len(called))


def probabilities(clean: list[Result]) -> Table:
    names = list(clean[0].answers)
    table = Table('Expected calibration error', 'clean frames of all sizes, 15 bins [%]', ['frames', *names])
    for on_off in (True, False):
        chosen = [result for result in clean if result.case.on_off == on_off]
        table.add(KIND[on_off], *(f'{100 * calibration(chosen, name):.2f}' for name in names))
    return table


def recordings(contest: Contest, recogniser: Recogniser) -> Table:
    """Return the table of real touches, labelled by a person and not used for training or tuning."""
    table = Table('Real recordings', 'share of each answer [%] in frames with the object and in frames without it, '
                  'where any shape is wrong; labels by hand; single frames, and ours as a stream, too',
                  ['recording', 'labelled', 'frames', 'contestant', *(shape.value for shape in ORDER)])
    for name in RECORDED:
        for label in FRAME_LABELS:
            for contestant, answer in _recorded_answers(contest, recogniser, name, label).items():
                share = np.bincount(answer.argmax(1), minlength=len(ORDER)) / len(answer)
                table.add(name, label, len(answer), contestant, *(f'{100 * s:.0f}' for s in share))
    return table


def _recorded_answers(contest: Contest, recogniser: Recogniser, name: str, label: str) -> dict[str, np.ndarray]:
    """Return the answers of each contestant for frames with ``label``, or an empty dict if there are none."""
    chosen = np.flatnonzero(frame_labels(name) == label)
    if not len(chosen):
        return {}
    stamps, frames = recorded(name)
    extractor = PatternExtractor(unit='1')
    patterns = [extractor.extract(frame) for frame in frames]
    reported = streamed(recogniser, stamps, frames)
    samples = patches([patterns[k] for k in chosen], np.zeros(len(chosen), int))
    answers = {OURS: answers_of(contest.ours, [patterns[k] for k in chosen]), f'{OURS}, stream': reported[chosen]}
    return answers | {anchor.name: anchor.probabilities(samples) for anchor in contest.anchors[True]}
