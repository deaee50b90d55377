"""What the demo's topics reported of each touch, beside what really touched."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tactile_node.simulator.touches import Touch


class Seen(NamedTuple):
    """One recognised frame: time [s since operational], probabilities by shape name, taxels (rows, cols) [Pa]."""

    time: float
    probabilities: Mapping[str, float]
    taxels: np.ndarray


class Verdict(NamedTuple):
    """One touch of one pad and what was made of it over the frames in which it was held steadily."""

    pad: str
    touch: Touch
    recognised: str
    confidence: float  #: mean probability of ``recognised`` over the frames
    frames: int
    taxels: np.ndarray  #: the middle frame [Pa]

    @property
    def right(self) -> bool:
        return self.recognised == self.touch.contact.shape


def verdicts_of(pad: str, touches: tuple[Touch, ...], seen: list[Seen]) -> list[Verdict]:
    """Return a verdict for each touch; one that is in no frame has none."""
    held = ((touch, [frame for frame in seen if touch.is_steady(frame.time)]) for touch in touches)
    return [_verdict(pad, touch, frames) for touch, frames in held if frames]


def _verdict(pad: str, touch: Touch, frames: list[Seen]) -> Verdict:
    means = {name: float(np.mean([frame.probabilities[name] for frame in frames]))
             for name in frames[0].probabilities}
    recognised = max(means, key=means.__getitem__)
    return Verdict(pad=pad, touch=touch, recognised=recognised, confidence=means[recognised], frames=len(frames),
                   taxels=frames[len(frames) // 2].taxels)
