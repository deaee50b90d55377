"""Facts about a touch, and the touches of a pad. Stamps are Unix time [s]."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tactile_node.pose.events import Event
from tactile_node.pose.fit import ShapeFit
from tactile_node.shape.recognition import ShapeClass, UnknownReason


class Sample(NamedTuple):
    """A taxel frame of a touch in which the shape was recognised."""

    stamp: float
    shape: ShapeClass  #: shape, fused over the touch so far
    confidence: float
    force: float       #: [N]; NaN if not known


@dataclass(frozen=True)
class Picture:
    """The frame in which a touch pressed most."""

    stamp: float
    values: np.ndarray       #: (rows, cols), NaN = no valid value
    fit: ShapeFit | None     #: None without an outline


@dataclass(frozen=True)
class ReportedTouch:
    """A run of taxel frames with a contact; see `touch_finder`."""

    begin: float
    end: float                    #: stamp of the last frame with the contact
    frames: int
    taxels: int                   #: number of taxels in the frame in which the touch pressed most
    shape: ShapeClass             #: shape that was recognised most often
    reason: UnknownReason         #: reason why the shape is UNKNOWN
    confidence: float             #: median confidence in this shape
    force: float                  #: force in the frame in which the touch pressed most [N]; NaN if not known
    force_is_bound: bool          #: True if the force is a lower bound
    size_is_bound: bool           #: True if the size is a lower bound
    is_open: bool                 #: True if the recording ends during the touch
    dimensions: tuple[tuple[str, float], ...]  #: names and lengths [m] of the fitted outline
    picture: Picture | None       #: None if there are too many touches
    events: tuple[Event, ...] = ()  #: events in the samples, from the centre of pressure


MOST_TOUCHES = 500  #: number of touches on the page
MOST_PICTURES = 24  #: number of pictures; a page with 2 pads then stays below 1 MB


class TouchList(list[ReportedTouch]):
    """Touches in the order of time, at most MOST_TOUCHES, because the outline of each touch takes time."""

    left_out = 0  #: number of touches beyond MOST_TOUCHES
    small_frames = 0  #: number of frames with a contact of too few taxels for a touch

    def keep_pictures(self) -> None:
        """Keep only the pictures of the MOST_PICTURES longest touches."""
        longest = sorted(((touch.end - touch.begin, k) for k, touch in enumerate(self)), reverse=True)
        for _, k in longest[MOST_PICTURES:]:
            self[k] = replace(self[k], picture=None)
