"""Records of the touches on a pad. Stamps are Unix time [s]."""

from dataclasses import dataclass, replace
from typing import NamedTuple

from tactile_node.pose.events import Event
from tactile_node.shape.recognition import ShapeClass
from tactile_node.viewing.states import PadState, SeenContact


class Sample(NamedTuple):
    """Result of shape recognition in one taxel frame of a touch."""

    stamp: float
    shape: ShapeClass             #: shape fused over the touch so far
    confidence: float
    force: float       #: force of the contact [N], or NaN if unknown


@dataclass(frozen=True)
class ReportedTouch:
    """A run of taxel frames with a contact, as defined in `touch_finder`."""

    begin: float
    end: float                    #: stamp of the last frame with the contact
    frames: int
    is_open: bool                 #: True if the recording ends during the touch
    #: the contact when it pressed hardest; its shape is the most frequent one, with the median of the confidence
    contact: SeenContact
    #: the frame in which the contact pressed hardest, or None if the page already shows enough longer touches
    picture: PadState | None
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
