"""Which bus each CAN frame of a log is of."""

from collections.abc import Collection
from typing import NamedTuple

import can

from tactile_node.assembly.router import non_data_kind


class TwoBuses(NamedTuple):
    """CAN frames that the pads' taxels need were on two buses."""

    can_id: int  #: what the frame on the second has
    channels: tuple[str, ...]


class ChosenChannel:
    """Takes the frames of ``channel``, and those sent without a name where it is the log's first bus; '' is all."""

    def __init__(self, channel: str):
        self._channel = channel
        self._received: list[str] = []  # channels
        self.others: set[str] = set()  #: channels with frames that were not taken

    def takes(self, message: can.Message) -> bool:
        channel = str(message.channel)
        if not self._channel or channel == self._channel:
            return True
        if message.is_rx and channel not in self._received:
            self._received.append(channel)
        is_nameless = not message.is_rx and channel not in self._received
        if is_nameless and self._received[:1] in ([], [self._channel]):
            return True
        self.others.add(channel)
        return False


class OneBus:
    """Watches that CAN frames with one of ``can_ids`` come from one bus."""

    def __init__(self, can_ids: Collection[int]):
        self._can_ids = frozenset(can_ids)
        self._received: set[str] = set()  # channels
        self._used: dict[str, int] = {}  # channels of can_ids, each with its first

    def feed(self, message: can.Message) -> TwoBuses | None:
        """Take the next frame of the log; return the fault where it is of a second bus."""
        channel = str(message.channel)
        is_known = channel in self._received or not message.is_rx
        if not is_known:
            self._received.add(channel)
        is_counted = (channel in self._used or message.arbitration_id not in self._can_ids
                      or non_data_kind(message) is not None)
        if is_known and is_counted:
            return None
        if not is_counted:
            self._used[channel] = message.arbitration_id
        buses = [used for used in self._used if used in self._received] or list(self._used)
        return TwoBuses(self._used[buses[-1]], tuple(buses)) if len(buses) > 1 else None
