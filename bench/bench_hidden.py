"""Measure how many answers for partly hidden contacts are right, and how many are wrong but confident.

The script is part of `make bench`.

The first table covers contacts of 12-100 taxels at random positions, as nominal pressures (1 % noise, blur, tilt) and
as on/off patterns. Each case has 600 contacts, or 2000 contacts if taxels are dead. Taxels are hidden because they are
dead, or because a TPDO with 8 taxels of one row is lost. The lost TPDOs are scattered over the contact, or they hide
adjacent rows that are 8 columns or the whole pad wide. The recogniser runs once on the visible taxels alone, and once
on several completions of the hidden taxels (`completions` in `shape/methods.py`). The weights of the completions were
chosen with validation seeds.

The second table covers whole sessions with contacts of 40-100 taxels on a 16x16 pad with 32 TPDOs. Some of the 32 TPDOs
never arrive. The second table compares single frames with ten fused frames, both with default settings. The third table
shows the results for contacts with few hidden taxels, and for the same contacts without hidden taxels.
"""

import sys
from pathlib import Path
from time import process_time

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np
from scipy import ndimage

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.package_files import config_path
from tactile_node.shape.fusion import RecognitionFusion
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.recogniser import ShapeRecogniser
from tactile_node.shape.recognition import LEARNED, METHOD_FILES, Recognition, Shape
from tactile_node.shape.support import SURE
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import CLASSES, Contact, random_contact
from training.field import NOMINAL_ON_OFF, Conditions, field_frame
from training.ground_truth.seeds import Purpose, generator

PRESSURE = Conditions(tilt=0.2, blur=0.5, noise=0.01)
AREAS = (12, 100)
TPDO = 8
PAD, PAD_TPDOS, LOST_AREAS, LOST_CONTACTS, LOST_SEED = 16, 32, (40, 100), 500, 34_000
LITTLE = 0.15  #: Upper limit for few hidden taxels, as a share of the contact and the taxels around it.
LITTLE_CONTACTS = 2000
LITTLE_MISSING = (1, 10)  #: Smallest and largest number of missing TPDOs.
LITTLE_SEED = 35_000
CASES = (('nothing', 0), ('TPDOs', 2), ('TPDOs', 4), ('adjacent rows', 2), ('adjacent rows', 3), ('adjacent rows', 5),
         ('dead', 0.03))


def main() -> None:
    alone = ShapeRecogniser.from_file(config_path(METHOD_FILES[LEARNED]))
    methods = {'alone': alone, 'with readings': make_recogniser()}
    print('| hidden | frames | ' + ' | '.join(f'right, {name} | wrong and > {SURE}' for name in methods) + ' | ms |')
    print('| --- ' * (2 * len(methods) + 3) + '|')
    for kind, amount in CASES:
        for on_off in (False, True):
            cases = list(contacts(kind, amount, on_off))
            cells = []
            for method in methods.values():
                begun = process_time()
                answers = [(truth, method.recognise(pattern)) for truth, pattern in cases]
                cost = (process_time() - begun) / len(cases) * 1e3
                cells += [f'{np.mean([found.shape is truth for truth, found in answers]):.1%}',
                          f'{np.mean([misleads(truth, found) for truth, found in answers]):.1%}']
            print(f'| {amount} {kind} | {"on/off" if on_off else "pressure"} | {" | ".join(cells)} | {cost:.2f} |',
                  flush=True)
    lost_tpdos()
    little_hidden()


def lost_tpdos() -> None:
    """Print a table of sessions in which some of the PAD_TPDOS TPDOs are missing, either scattered or consecutive."""
    recogniser = make_recogniser()
    print('\n| missing TPDOs | frames | wrong and sure, one frame | fused | little hidden: right and sure, one frame '
          '| fused |\n' + '| --- ' * 6 + '|')
    for number, (missing, in_a_row) in enumerate(((0, False), (2, False), (2, True), (8, False), (8, True), (16, False),
                                                  (16, True))):
        for on_off in (False, True):
            rng, wrong, right = generator(Purpose.EVALUATION, LOST_SEED + 10 * number + on_off), [], []
            for k in range(LOST_CONTACTS):
                truth, frames, share = session(rng, CLASSES[k % len(CLASSES)], missing, in_a_row, on_off)
                answers = [recogniser.recognise(pattern) for pattern in frames]
                fusion = RecognitionFusion()
                fused = [fusion.update(0.02 * n, answer) for n, answer in enumerate(answers)][-1].recognition
                wrong.append([misleads(truth, answer) for answer in (answers[0], fused)])
                if share < LITTLE:
                    right.append([answer.shape is truth and answer.confidence >= SURE
                                  for answer in (answers[0], fused)])
            cells = [f'{share:.1%}' for share in np.mean(wrong, 0)]
            cells += [f'{share:.1%} of {len(right)}' for share in np.mean(right, 0)] if right else ['-', '-']
            print(f'| {missing} {"in a row" if in_a_row else "anywhere"} | {"on/off" if on_off else "pressure"} | '
                  f'{" | ".join(cells)} |', flush=True)


def little_hidden() -> None:
    """Print the rates for contacts with a hidden share below LITTLE, and for the same contacts in full view."""
    recogniser = make_recogniser()
    print(f'\n| less than {LITTLE:.0%} hidden | contacts | right | right, all seen | wrong and sure |\n'
          + '| --- ' * 5 + '|')
    for on_off in (False, True):
        rng, found = generator(Purpose.EVALUATION, LITTLE_SEED + on_off), []
        while len(found) < LITTLE_CONTACTS:
            truth = Shape(CLASSES[len(found) % len(CLASSES)])
            frame = read_contact(rng, _on_pad(rng, truth.value), on_off)
            lost = lost_taxels(rng, int(rng.integers(*LITTLE_MISSING, endpoint=True)), bool(rng.integers(2)))
            if 0 < share_hidden(frame, lost, thresholds(on_off)) < LITTLE:
                answers = [recogniser.recognise(PatternExtractor(thresholds(on_off)).extract(seen))
                           for seen in (np.where(lost, np.nan, frame), frame)]
                found.append([answer.shape is truth for answer in answers] + [misleads(truth, answers[0])])
        cells = [f'{share:.1%}' for share in np.mean(found, 0)]
        print(f'| {"on/off" if on_off else "pressure"} | {len(found)} | {" | ".join(cells)} |', flush=True)


def session(rng: np.random.Generator, name: str, missing: int, in_a_row: bool,
            on_off: bool) -> tuple[Shape, list[ContactPattern], float]:
    """Return the true shape, ten patterns, and the hidden share of the contact and the taxels around it."""
    contact, lost, press = _on_pad(rng, name), lost_taxels(rng, missing, in_a_row), thresholds(on_off)
    frames = [read_contact(rng, contact, on_off) for _ in range(1 if on_off else 10)]
    patterns = [PatternExtractor(press).extract(np.where(lost, np.nan, frame)) for frame in frames]
    return Shape(name), patterns * (10 if on_off else 1), share_hidden(frames[-1], lost, press)


def thresholds(on_off: bool) -> PressThresholds:
    return PressThresholds(0.5, 0.4) if on_off else PressThresholds(0.25, 0.2)


def lost_taxels(rng: np.random.Generator, missing: int, in_a_row: bool) -> np.ndarray:
    order = (np.arange(PAD_TPDOS) + rng.integers(PAD_TPDOS)) % PAD_TPDOS if in_a_row else rng.permutation(PAD_TPDOS)
    return np.isin(np.arange(PAD * PAD).reshape(PAD, PAD) // TPDO, order[:missing])


def read_contact(rng: np.random.Generator, contact: Contact, on_off: bool) -> np.ndarray:
    return contact.pattern(PAD, PAD).astype(float) if on_off else pressure_frame(
        contact, rng, PAD, PAD, skin=Skin(full_scale=1.0, noise=0.01, blur=0.5))


def share_hidden(frame: np.ndarray, lost: np.ndarray, press: PressThresholds) -> float:
    return float(lost[ndimage.binary_dilation(frame >= press.press, np.ones((3, 3)))].mean())


def _on_pad(rng: np.random.Generator, name: str) -> Contact:
    while True:
        contact = random_contact(rng, name, float(np.exp(rng.uniform(*np.log(LOST_AREAS)))), rows=PAD, cols=PAD)
        outline = contact.outline()
        if outline.min() > -0.5 and outline.max() < PAD - 0.5:
            return contact


def misleads(truth: Shape, found: Recognition) -> bool:
    return found.shape not in (truth, Shape.UNKNOWN, Shape.NONE) and found.confidence > SURE


def contacts(kind: str, amount: float, on_off: bool) -> list[tuple[Shape, ContactPattern]]:
    """Return the true shapes and the patterns of all contacts that are at least partly visible."""
    rng, found = generator(Purpose.EVALUATION, 32_000 + int(10 * amount) + 100 * on_off), []
    press = 0.5 if on_off else 0.25
    for k in range(2000 if kind == 'dead' else 600):
        name = CLASSES[k % len(CLASSES)]
        area = float(np.exp(rng.uniform(*np.log(AREAS))))
        frame = field_frame(rng, name, area, NOMINAL_ON_OFF if on_off else PRESSURE)
        frame[hidden(rng, frame >= press, kind, amount)] = np.nan
        pattern = PatternExtractor(PressThresholds(press, 0.8 * press)).extract(frame)
        if pattern.contacts:
            found.append((Shape(name), pattern))
    return found


def hidden(rng: np.random.Generator, pressed: np.ndarray, kind: str, amount: float) -> np.ndarray:
    """Return a boolean (rows, cols) array of the hidden taxels."""
    taxels = np.zeros(pressed.shape, bool)
    rows, cols = np.flatnonzero(pressed.any(1)), np.flatnonzero(pressed.any(0))
    blocks = range((cols[0] - 1) // TPDO, (cols[-1] + 1) // TPDO + 1)
    if kind == 'dead':
        taxels = rng.random(pressed.shape) < amount
    elif kind == 'TPDOs':
        near = [(row, block) for row in range(rows[0] - 1, rows[-1] + 2) for block in blocks]
        for row, block in (near[k] for k in rng.permutation(len(near))[:int(amount)]):
            taxels[row, block * TPDO:(block + 1) * TPDO] = True
    elif kind == 'adjacent rows':
        first, block = rng.integers(rows[0] - amount + 1, rows[-1] + 1), rng.integers(blocks.start, blocks.stop)
        across = slice(None) if rng.random() < 0.5 else slice(block * TPDO, (block + 1) * TPDO)
        taxels[max(first, 0):max(first + int(amount), 0), across] = True
    return taxels


if __name__ == '__main__':
    main()
