"""A virtual bus for tests of faults: its adapter can be unplugged or lose frames."""

from collections import deque
from collections.abc import Callable, Iterable

import can
from can.interfaces.virtual import VirtualBus

from tactile_node.errors import BusError


class Adapter:
    """Replaces ``open_bus``, and opens buses into which faults can be injected.

    Each fault affects all open buses, and all buses that are opened later.
    """

    def __init__(self):
        self.lost: list[bytes] = []  #: data of the frames that the adapter lost
        self.opened = 0
        self.mend()

    def mend(self) -> None:
        """Remove all faults."""
        self.is_plugged = self.can_send = True
        #: CAN identifiers of the frames that the adapter loses
        self.lost_ids: set[int] = set()
        #: function that maps each frame to the frames to pass on in its place
        self.tamper: Callable[[can.Message], Iterable[can.Message]] | None = None

    def open(self, interface: str, channel: str, bitrate: int) -> can.BusABC:
        if not self.is_plugged:
            raise BusError(f'CAN bus {interface} {channel}', expected='a bus that opens', got='no such device',
                           remedy='Plug it in.')
        self.opened += 1
        return FaultyBus(self, channel)


class FaultyBus(VirtualBus):
    def __init__(self, adapter: Adapter, channel: str):
        self._adapter, self._pending = adapter, deque()
        super().__init__(channel=channel)

    def _recv_internal(self, timeout):
        if not self._adapter.is_plugged:
            raise can.CanOperationError('Network is down', 100)
        if self._pending:
            return self._pending.popleft(), False
        message, filtered = super()._recv_internal(timeout)
        if message is not None and message.arbitration_id in self._adapter.lost_ids:
            self._adapter.lost.append(bytes(message.data))
            return None, filtered
        if message is not None and self._adapter.tamper is not None:
            self._pending.extend(self._adapter.tamper(message))
            return (self._pending.popleft(), False) if self._pending else (None, filtered)
        return message, filtered

    def send(self, msg, timeout=None):
        if not (self._adapter.is_plugged and self._adapter.can_send):
            raise can.CanOperationError('Transmit buffer full', 105)
        super().send(msg, timeout)
