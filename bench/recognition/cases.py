"""The evaluated cases: patterns on which no method was trained, by condition, kind of frame and size."""

import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import NamedTuple

import numpy as np

from bench.recognition import mechanics
from tactile_node import find_contact
from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.shape.invariants import describe_all
from tactile_node.shape.patch import joined, make_patch
from tactile_node.simulator.world import CLASSES
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.pads import PadSettings
from tactile_node.sources.log_source import LogSource
from training.field import NOMINAL_ON_OFF, NOMINAL_PRESSURE, Conditions, field_frame
from training.ground_truth.seeds import Purpose, generator
from training.samples import LABELS, LEVEL_STEPS, Samples

DATA = Path(__file__).resolve().parents[2] / 'test/data'
BY_HAND, FRAME_LABELS = Path(__file__).parent / 'labels', ('object', 'not', 'unclear')
#: Fixed thresholds for pressures. Conditions with shifted thresholds use multiples of these values.
PRESS = 0.3
RELEASE = 0.24
CLEAN = 'clean'
#: Increase this number for each new report. Evaluation seeds serve only one report, because reports lead to changes.
ROUND = 7
PUNCHES, PUNCH_AREAS = 'flat punches', (12, 25, 50, 100)
FEWER = 10           #: Flat punches are this many times as frequent as any other indenter.
DEVELOPMENT = 500    #: Round of the development seeds, which are never reported.

#: Deviations from the nominal conditions, for both kinds of frames.
FIELD: dict[str, dict] = {
    'dead taxels, 10 % (NaN)': {'dead': 0.10},
    'stuck taxels, 3 % (unknown)': {'stuck': 0.03},
    'two silent rows or columns': {'silent_lines': 2},
    'a tenth of the rows and columns poor': {'poor_lines': 0.1},
    'elastomer blur 1 pitch': {'blur': 1.0},
    'noise 5 % of full scale': {'noise': 0.05},
    'tilt 60 % over the radius': {'tilt': 0.6},
    'threshold 0.35 instead of 0.5': {'threshold': 0.35},
    'threshold 0.7 instead of 0.5': {'threshold': 0.7},
    'a sixth cut off by the edge': {'cut': 1 / 6},
    'a third cut off by the edge': {'cut': 1 / 3},
    'a second contact, half as large': {'second': 0.5, 'gap': 4.0},
    'hollow, wall 0.4 of inner radius': {'wall': 0.4},
    'hollow, poor rows and columns': {'wall': 0.4, 'poor_lines': 0.1},
    'rounded corners, 0.4 of inner radius': {'rounding': 0.4},
}


class Case(NamedTuple):
    """Patterns of one condition and size.

    ``labels`` are indices into LABELS, with UNKNOWN for outliers. ``samples`` are the patches that the anchors get.
    """

    condition: str
    on_off: bool
    area: float
    patterns: list[ContactPattern]
    samples: Samples

    @property
    def labels(self) -> np.ndarray:
        return self.samples.labels


def make_case(seed: int, condition: str, on_off: bool, area: float, count: int, purpose: Purpose) -> Case:
    """Draw ``count`` patterns, cycling through CLASSES. A contact that presses no taxel counts as not recognised."""
    rng, nominal = seeded(seed, purpose), NOMINAL_ON_OFF if on_off else NOMINAL_PRESSURE
    conditions = replace(nominal, **FIELD.get(condition, {}))
    shapes = [CLASSES[k % len(CLASSES)] for k in range(count)]
    patterns = [extracted(field_frame(rng, shape, area, conditions), conditions) for shape in shapes]
    labels = np.array([LABELS.index(shape) for shape in shapes])
    return Case(condition=condition, on_off=on_off, area=area, patterns=patterns,
                samples=patches(patterns, labels, bool(conditions.second)))


def extracted(frame: np.ndarray, conditions: Conditions) -> ContactPattern:
    """Return the pattern found with default settings, or with a fixed threshold if the threshold is shifted."""
    if conditions.on_off:
        return PatternExtractor(PressThresholds(0.5, 0.4)).extract(frame)
    drift = conditions.threshold / Conditions.threshold
    if drift == 1:
        return find_contact(frame, unit=None)
    return PatternExtractor(PressThresholds(PRESS * drift, RELEASE * drift)).extract(frame)


def patches(patterns: list[ContactPattern], labels: np.ndarray, largest: bool = False) -> Samples:
    """Return the samples for the anchors, with torn pieces joined or, if ``largest``, from the largest contact alone.
    """
    made = []
    for pattern in patterns:
        mask = pattern.mask if largest else joined(pattern)
        if not mask.any():
            mask = np.zeros_like(mask)
            mask[0, 0] = True
        made.append(make_patch(pattern.values, mask))
    levels = np.array([np.clip(patch.level * LEVEL_STEPS + 0.5, 0, 255) for patch in made]).astype(np.uint8)
    unseen = np.array([patch.unseen * 255 + 0.5 for patch in made]).astype(np.uint8)
    numbers = describe_all(np.array([patch.level for patch in made]), np.array([patch.unseen for patch in made]),
                           np.array([patch.scale for patch in made]))
    return Samples(levels, unseen, numbers, labels)


def clean_cases(areas: tuple[int, ...], count: int, purpose: Purpose) -> Iterator[Case]:
    for on_off in (True, False):
        for area in areas:
            yield make_case(1000 * on_off + area, CLEAN, on_off, area, count, purpose)


def field_cases(areas: tuple[int, ...], count: int, purpose: Purpose) -> Iterator[Case]:
    for number, condition in enumerate(FIELD):
        for on_off in (True, False):
            for area in areas:
                yield make_case(10_000 * (number + 1) + 1000 * on_off + area, condition, on_off, area, count, purpose)


def mechanics_cases(count: int, purpose: Purpose) -> Iterator[Case]:
    """Yield cases of computed contacts, with patterns that the library finds with default settings."""
    rounds = ROUND if purpose is Purpose.EVALUATION else DEVELOPMENT
    for number, (name, draw) in enumerate(mechanics.ROWS.items()):
        for area in PUNCH_AREAS:
            drawn = mechanics.pressed(draw, area, count if name == PUNCHES else max(count // FEWER, 1),
                                      1_000_000 * rounds + 1000 * number + area)
            patterns = [find_contact(frame, unit=None) for frame in drawn.frames]
            yield Case(name, False, area, patterns, patches(patterns, np.asarray(drawn.labels)))


def seeded(seed: int, purpose: Purpose) -> np.random.Generator:
    """Return the random generator for one case in this round of reports."""
    return generator(purpose, seed + 1_000_000 * ROUND)


def recorded(name: str) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the stamps [s] and the on/off frames of a recording from the real 64x64 array.

    The recording is a CAN log or a text file of events.
    """
    events = DATA / f'{name}.txt.gz'
    return _events(events) if events.exists() else _log(DATA / f'{name}.log.gz')


def _events(path: Path) -> tuple[np.ndarray, list[np.ndarray]]:
    """Read lines "stamp row column pressed". The stamps [ms] assume the array's usual polling rate of 16 Hz."""
    events = np.loadtxt(path, int)
    stamps, polls = np.unique(events[:, 0], return_inverse=True)
    frames = np.zeros((len(stamps), 64, 64))
    for poll, (_, row, col, pressed) in zip(polls, events):  # the state of the taxel holds from this poll on
        frames[poll:, row, col] = pressed
    return stamps * 1e-3, list(frames)


def _log(path: Path) -> tuple[np.ndarray, list[np.ndarray]]:
    pad, frames = PadSettings('pad', (32,), load_layout('nus_sinapse_64x64.yaml')), []
    LogSource(str(path), (pad,), lambda name, frame: frames.append(frame), pace=None).play(Event())
    return np.array([frame.stamp for frame in frames]), [frame.values for frame in frames]


def frame_labels(recording: str) -> np.ndarray:
    """Return the manual label of each frame in ``recording`` (a name without suffix) as an array of str.

    The function raises ValueError if ranges of frames overlap or leave gaps, or if a label is not in FRAME_LABELS.
    """
    lines = (BY_HAND / f'{recording}.csv').read_text(encoding='utf-8').splitlines()
    found: list[str] = []
    for row in csv.DictReader(line for line in lines if not line.startswith('#')):
        first, last, label = int(row['first_frame']), int(row['last_frame']), row['label']
        if first != len(found) or last < first or label not in FRAME_LABELS:
            raise ValueError(f'{recording}: expected frames from {len(found)} on with one of {FRAME_LABELS}, got {row}')
        found += [label] * (last - first + 1)
    return np.array(found)
