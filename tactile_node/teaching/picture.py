"""A picture of what is taken for what on held-out contacts (needs matplotlib)."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tactile_node.shape.recogniser import OUTPUTS
from tactile_node.teaching.teach import HeldOut

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def confusion_picture(held_out: HeldOut, names: Sequence[str]) -> 'Figure':
    """Draw each truth as a row, in per cent of its contacts; ``names``: of the taught shapes."""
    from matplotlib.figure import Figure  # optional, and slow to import

    answers = [shape.value.replace('_', ' ') for shape in OUTPUTS] + [name.replace('_', ' ') for name in names]
    counts = held_out.after
    totals = counts.sum(1)
    shares = 100 * counts / np.maximum(totals, 1)[:, None]
    side = 0.72 * len(answers)
    figure = Figure(figsize=(side + 2.6, side + 1.7), layout='constrained')
    axes = figure.subplots()
    image = axes.imshow(shares, cmap='Blues', vmin=0, vmax=100)
    truths = [f'{name if name != "unknown" else "foreign"} ({total})' for name, total in zip(answers, totals)]
    axes.set_xticks(range(len(answers)), answers, rotation=40, ha='right')
    axes.set_yticks(range(len(answers)), truths)
    for row, col in zip(*counts.nonzero()):
        share = shares[row, col]
        axes.text(col, row, f'{share:.0f}' if share >= 10 else f'{share:.1f}', ha='center', va='center', fontsize=9,
                  color='white' if share > 50 else 'black')
    axes.set_xlabel('recognised as')
    axes.set_ylabel('is (contacts held out)')
    figure.colorbar(image, label='% of the row', shrink=0.7)
    axes.set_title('What is taken for what', fontsize=11)
    return figure
