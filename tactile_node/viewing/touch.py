"""Records of the touches on a pad. Stamps are Unix time [s]."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tactile_node.pose.events import Event
from tactile_node.pose.fit import ShapeFit
from tactile_node.shape.recognition import ShapeClass, UnknownReason


class Sample(NamedTuple):
    """Result of shape recognition in one taxel frame of a touch."""

    stamp: float
    shape: ShapeClass             #: shape fused over the touch so far
    confidence: float
    force: float       #: force of the contact [N], or NaN if unknown


@dataclass(frozen=True)
class Picture:
    """The frame in which a touch pressed hardest."""

    stamp: float
    values: np.ndarray       #: taxel values (rows, cols), NaN where there is no valid value
    fit: ShapeFit | None     #: fitted outline, or None if there is none


@dataclass(frozen=True)
class ReportedTouch:
    """A run of taxel frames with a contact, as defined in `touch_finder`."""

    begin: float
    end: float                    #: stamp of the last frame with the contact
    frames: int
    taxels: int                   #: number of taxels in the frame in which the touch pressed hardest
    shape: ShapeClass             #: shape that was recognised most often
    reason: UnknownReason         #: reason why the shape is UNKNOWN
    confidence: float             #: median confidence in this shape
    force: float                  #: force in the frame in which the touch pressed hardest [N], or NaN if unknown
    force_is_bound: bool          #: True if the force is a lower bound
    size_is_bound: bool           #: True if the size is a lower bound
    is_open: bool                 #: True if the recording ends during the touch
    dimensions: tuple[tuple[str, float], ...]  #: names and lengths of the dimensions of the fitted outline [m]
    picture: Picture | None       #: picture of the touch, or None if the page already shows enough longer touches
    events: tuple[Event, ...] = ()  #: motion events detected from the centre of pressure


MOST_TOUCHES = 500  #: maximum number of touches listed for a pad
MOST_PICTURES = 24  #: maximum number of pictures per pad, so that a page with 2 pads stays below 1 MB


class TouchList(list[ReportedTouch]):
    """At most MOST_TOUCHES touches in chronological order, because fitting the outline of each touch takes time."""

    left_out = 0  #: number of touches beyond MOST_TOUCHES
    small_frames = 0  #: number of frames whose contact is too small for a touch

    def keep_pictures(self) -> None:
        """Keep only the pictures of the MOST_PICTURES longest touches."""
        longest = sorted(((touch.end - touch.begin, k) for k, touch in enumerate(self)), reverse=True)
        for _, k in longest[MOST_PICTURES:]:
            self[k] = replace(self[k], picture=None)
