"""Contacts cut by what is not seen: how often right, how often confident and wrong. Part of `make bench`.

Contacts of 12-100 taxels in general position, nominal pressures (1 % noise, blur, tilt) and on/off, 600 of each case
(dead taxels: 2000). Hidden: lost TPDOs of 8 taxels in a row, single ones anywhere over the contact or adjacent rows of
8 columns or of the whole pad, or dead taxels anywhere. The recogniser alone, and with hidden taxels read in several
ways (`shape/completion.py`). Weights of the readings were chosen on validation seeds.
"""

import sys
from pathlib import Path
from time import process_time

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.package_files import config_path
from tactile_node.shape.methods import FILES, LEARNED, Learned, make_recogniser
from tactile_node.shape.recognition import Recognition, Shape
from tactile_node.synthetic.seeds import Purpose, generator
from tactile_node.synthetic.world import CLASSES
from training.field import NOMINAL_ON_OFF, Conditions, field_frame

PRESSURE = Conditions(tilt=0.2, blur=0.5, noise=0.01)
AREAS, TPDO, SURE = (12, 100), 8, 0.9
CASES = (('nothing', 0), ('TPDOs', 2), ('TPDOs', 4), ('adjacent rows', 2), ('adjacent rows', 3), ('adjacent rows', 5),
         ('dead', 0.03))


def main() -> None:
    methods = {'alone': Learned(config_path(FILES[LEARNED])), 'with readings': make_recogniser()}
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


def misleads(truth: Shape, found: Recognition) -> bool:
    return found.shape not in (truth, Shape.UNKNOWN, Shape.NONE) and found.confidence > SURE


def contacts(kind: str, amount: float, on_off: bool) -> list[tuple[Shape, ContactPattern]]:
    """Shapes and patterns; a contact of which nothing is seen is left out."""
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
    """Which taxels are not seen."""
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
