"""Distinguish the buses in a log by the channel of each CAN frame."""

from collections.abc import Collection

import can

from tactile_node.assembly.router import non_data_kind


class ChosenChannel:
    """Selects the frames of one bus.

    Sent frames may have no channel name. Frames without a channel name are selected if the chosen bus is the first bus
    in the log.

    Parameters
    ----------
    channel
        Name of the bus, or '' to select all frames.
    """

    def __init__(self, channel: str):
        self._channel = channel
        self._received: list[str] = []  # channels of received frames, in log order
        self.others: set[str] = set()  #: channels of frames that were not selected

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
    """Checks that all CAN frames whose identifiers are in ``can_ids`` come from the same bus."""

    def __init__(self, can_ids: Collection[int]):
        self._can_ids = frozenset(can_ids)
        self._received: set[str] = set()  # channels of received frames
        self._used: dict[str, int] = {}  # first identifier from ``can_ids`` on each channel

    def feed(self, message: can.Message) -> str:
        """Process the next frame of the log.

        Returns
        -------
        str
            Identifier of a frame from a second bus with the names of the buses, or '' if all frames come from one bus.
        """
        channel = str(message.channel)
        is_known = channel in self._received or not message.is_rx
        if not is_known:
            self._received.add(channel)
        is_counted = (channel in self._used or message.arbitration_id not in self._can_ids
                      or non_data_kind(message) is not None)
        if is_known and is_counted:
            return ''
        if not is_counted:
            self._used[channel] = message.arbitration_id
        buses = [used for used in self._used if used in self._received] or list(self._used)
        return f'0x{self._used[buses[-1]]:03X} on {" and on ".join(buses)}' if len(buses) > 1 else ''
