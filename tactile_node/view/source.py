"""What any source of a view offers."""

from typing import Protocol

from tactile_node.view.states import PadState
from tactile_node.view.store import Store


class Player(Protocol):
    """The part of a recording's source that a person controls."""

    @property
    def position(self) -> float:
        """Time shown [s since the begin of the recording]."""

    @property
    def length(self) -> float:
        """Of what is read so far [s]."""

    @property
    def is_complete(self) -> bool:
        """Whether all of the recording is read."""

    @property
    def is_playing(self) -> bool: ...

    def play(self, is_playing: bool) -> None:
        """Continue, from the begin where it is at its end; or pause."""

    def seek(self, position: float) -> None:
        """Show what was seen at ``position`` [s]."""


class Source(Protocol):
    """Puts what it sees into ``store``, only between `start` and `stop`."""

    title: str
    store: Store

    @property
    def player(self) -> Player | None:
        """None: what is shown is live."""

    def check(self) -> None:
        """Raise TactileError where it cannot be used; called once, before the first start."""

    def start(self) -> None:
        """Somebody looks; `check` has passed. What fails now is shown as the store's problem."""

    def stop(self) -> None:
        """No one looks: compute nothing."""

    def close(self) -> None:
        """Release everything; allowed in any state."""

    def age(self, state: PadState) -> float:
        """Time since ``state`` was acquired [s]; in a recording, until the position that is shown."""
