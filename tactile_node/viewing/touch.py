"""The facts of a touch, and the touches of a pad. Stamps are Unix time [s]."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tactile_node.pose.events import Event
from tactile_node.pose.fit import ShapeFit
from tactile_node.shape.recognition import ShapeClass, UnknownReason


class Sample(NamedTuple):
    """A taxel frame of a touch whose shape was recognised."""

    stamp: float
    shape: ShapeClass  #: fused over the touch so far
    confidence: float
    force: float       #: [N]; NaN: not known


@dataclass(frozen=True)
class Picture:
    """The frame in which a touch pressed most."""

    stamp: float
    values: np.ndarray       #: (rows, cols), NaN: no valid value
    fit: ShapeFit | None     #: None: no outline


@dataclass(frozen=True)
class ReportedTouch:
    """A run of taxel frames with a contact; see `touch_finder`."""

    begin: float
    end: float                    #: stamp of the last frame with the contact
    frames: int
    taxels: int                   #: in the frame in which it pressed most
    shape: ShapeClass             #: reported most often
    reason: UnknownReason         #: why it is UNKNOWN
    confidence: float             #: median of this shape's
    force: float                  #: in the frame in which it pressed most [N]; NaN: not known
    force_is_bound: bool
    size_is_bound: bool
    is_open: bool                 #: the recording ends within it
    dimensions: tuple[tuple[str, float], ...]  #: name, length [m]; of the fitted outline
    picture: Picture | None       #: None: too many touches
    events: tuple[Event, ...] = ()  #: by the centre of pressure, of the samples


MOST_TOUCHES = 500  #: on the page
MOST_PICTURES = 24  #: a page of 2 pads stays below 1 MB


class TouchList(list[ReportedTouch]):
    """Touches in their order in time, MOST_TOUCHES at most: the outline of each costs time."""

    left_out = 0  #: beyond MOST_TOUCHES
    small_frames = 0  #: frames with a contact of too few taxels for a touch

    def keep_pictures(self) -> None:
        """Keep the pictures of the MOST_PICTURES longest alone."""
        longest = sorted(((touch.end - touch.begin, k) for k, touch in enumerate(self)), reverse=True)
        for _, k in longest[MOST_PICTURES:]:
            self[k] = replace(self[k], picture=None)
