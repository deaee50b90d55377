"""Measure how soon the fusion follows a change of shape, and how often the reported shape flickers."""

from dataclasses import replace
from time import process_time

import numpy as np
from pose_world import PAD, PRESS, RELEASE

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.errors import TactileError
from tactile_node.shape.fusion import FusionSettings, RecognitionFusion
from tactile_node.shape.methods import METHODS, make_recogniser
from tactile_node.shape.recognition import Shape
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import CLASSES, random_contact
from training.ground_truth.seeds import Purpose, generator

PERIOD = 0.01   #: [s]
FRAMES = 60     #: Number of frames for each of two shapes, which follow each other without a break.
CREEP = 0.01    #: Movement of a contact per frame [pitches].
SKIN = Skin(blur=0.5, noise=0.02, dead=0.0)
SEQUENCES = 40


def measure(report) -> None:
    settings = FusionSettings()
    report.say(f'`frames_to_follow` states a latency of {settings.frames_to_follow(PERIOD, 100.0)} frames if each '
               f'frame gives odds of 100:1 to the new shape, and of {settings.frames_to_follow(PERIOD, 10.0)} frames '
               'at 10:1. The beginning and the end of a contact have no latency.')
    rows = []
    for method in METHODS:
        for area in (20, 50):
            try:
                rows.append([str(method), str(area), *_row(make_recogniser(method), area)])
            except TactileError as error:
                rows.append([str(method), str(area), f'not measured: {type(error).__name__}', *[''] * 6])
    report.table('Fusion of successive frames',
                 ['recogniser', 'N', 'right, single frames', 'right, fused (all frames)',
                  'right, fused, from 100 ms (200 ms after a change) on', 'flicker single', 'flicker fused',
                  'frames to follow a change, median; 95 %; most', 'fusion, ms a frame'], rows)


def _row(recogniser, area: float) -> list[str]:
    single, fused, settled, flicker, follows, spent, frames = 0, 0, [], [0, 0], [], 0.0, 0
    for number in range(SEQUENCES):
        rng = generator(Purpose.EVALUATION, 77_000 + number)
        truth, recognised = _sequence(rng, recogniser, area)
        fusion = RecognitionFusion()
        begin = process_time()
        said = [fusion.update(i * PERIOD, each).recognition.shape for i, each in enumerate(recognised)]
        spent += process_time() - begin
        alone = [each.shape for each in recognised]
        right = np.array([a is b for a, b in zip(said, truth)])
        single += sum(a is b for a, b in zip(alone, truth))
        fused += right.sum()
        settled += [*right[10:FRAMES], *right[FRAMES + 20:]]
        for i, shapes in enumerate((alone, said)):
            flicker[i] += max(0, sum(a is not b for a, b in zip(shapes, shapes[1:])) - 1)
        frames += len(truth)
        if right[FRAMES:].any():
            follows.append(int(right[FRAMES:].argmax()) + 1)
    return [f'{single / frames:.1%}', f'{fused / frames:.1%}', f'{np.mean(settled):.1%}',
            *(f'{count / frames * 100:.2f}' for count in flicker),
            f'{np.median(follows):.0f}; {np.percentile(follows, 95):.0f}; {max(follows)} '
            f'({SEQUENCES - len(follows)} never)',
            f'{spent / frames * 1e3:.3f}']


def _sequence(rng: np.random.Generator, recogniser, area: float):
    shapes = rng.choice(len(CLASSES), 2, replace=False)
    truth, recognised, extractor = [], [], PatternExtractor(PressThresholds(PRESS, RELEASE))
    for index in shapes:
        contact = random_contact(rng, CLASSES[index], area, rows=PAD, cols=PAD)
        heading = rng.uniform(0, 2 * np.pi)
        for i in range(FRAMES):
            moved = replace(contact, x=contact.x + CREEP * i * np.cos(heading),
                            y=contact.y + CREEP * i * np.sin(heading))
            pattern = extractor.extract(pressure_frame(moved, rng, PAD, PAD, skin=SKIN))
            recognised.append(recogniser.recognise(pattern))
            truth.append(Shape(contact.shape))
    return truth, recognised
