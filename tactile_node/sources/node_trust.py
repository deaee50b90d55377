"""Decide when the TPDOs of a node match the layout, and remove the other values of the node from its taxel frames."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from tactile_node.assembly.health import NodeFault
from tactile_node.assembly.router import OnFrame
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.skin.layout import DomainLayout, TpdoLayout
from tactile_node.skin.pads import CanopenNode
from tactile_node.sources.sender_watch import SenderWatch
from tactile_node.taxel_frame import TaxelFrame


class Setup(NamedTuple):
    """Counts of events that change a node's configuration. Equal counts mean an unchanged configuration."""

    boots: int           #: number of boot-up messages
    foreign_writes: int  #: number of writes by another master


class NodeTrust:
    """States when a node is trusted, and which of its values may be published.

    A node is trusted from the end of its configuration until one of these events:

    - The node sends a boot-up message, or another master writes to its TPDOs.
    - The bus is opened again.
    - The device may be another one: its identity is not confirmed, or one of two devices with its node-ID has gone.

    Values that were acquired before the node was trusted are removed, because the TPDOs may have had another mapping.
    While two devices send with the node-ID, all values of the node are removed.

    The supervisor's thread changes the trust. The chain calls ``only_trusted``.

    Parameters
    ----------
    node
        Node of a pad.
    monitor
        Monitor that counts the boot-up messages and the writes of other masters.
    senders
        Watch that detects two devices.
    """

    def __init__(self, node: CanopenNode, monitor: BusMonitor, senders: SenderWatch):
        self._node = node
        self._monitor = monitor
        self._heard = monitor.heartbeats.of(node.node_id)
        self._senders = senders
        self._configured: Setup | None = None
        self._trusted_from = 0.0  # time before which the node's TPDOs may not match the layout
        self.frames_distrusted = 0  #: number of taxel frames emitted without values of the node

    @property
    def setup(self) -> Setup:
        """Counts so far of events that change the configuration of the node."""
        return Setup(self._heard.boots, self._monitor.foreign_writes[self._node.node_id])

    @property
    def is_trusted(self) -> bool:
        return self._configured == self.setup

    @property
    def fault(self) -> NodeFault:
        """Reason why the TPDOs may not match the layout, or NONE."""
        if self.is_trusted:
            return NodeFault.NONE
        if self._configured is None:
            return NodeFault.UNCONFIGURED
        return NodeFault.RECONFIGURED if self._configured.boots == self._heard.boots else NodeFault.BOOTED

    def begin(self, setup: Setup, now: float) -> None:
        """Trust the node, because its configuration was complete at the time ``now`` [s].

        ``setup`` gives the event counts when the configuration began.
        """
        if not self.is_trusted:
            self._trusted_from = now
        self._configured = setup

    def end(self) -> None:
        """Distrust the node until it has been configured."""
        self._configured = None

    def only_trusted(self, frame: TaxelFrame) -> TaxelFrame:
        """Return ``frame`` without those values of the node that may not match the layout, and count such frames.

        Parameters
        ----------
        frame
            Taxel frame of the node's pad.
        """
        untrusted = self._untrusted(frame)
        if not untrusted:
            return frame
        self.frames_distrusted += 1
        return without_values(frame, untrusted)

    def _untrusted(self, frame: TaxelFrame) -> Sequence[TpdoLayout | DomainLayout]:
        """Return those of the node's TPDOs (or its DOMAIN) whose values in ``frame`` may not match the layout."""
        carriers, ages = self._node.layout.carriers, frame.tpdo_ages
        if not self.is_trusted or self._senders.are_two:
            return carriers
        if ages is None:
            return () if frame.acquired >= self._trusted_from else carriers
        return [carrier for carrier in carriers
                if carrier.taxels and frame.acquired - ages.of(*carrier.taxels[0][:2]) < self._trusted_from]


def deliver_trusted(trusts: Mapping[str, Sequence[NodeTrust]], on_frame: OnFrame, pad: str, frame: TaxelFrame) -> None:
    """Call ``on_frame`` with a taxel frame that contains only trusted values.

    Parameters
    ----------
    trusts : mapping of str to sequence of NodeTrust
        The trust in each node of each pad, by the name of the pad.
    on_frame : callable
        Function that is called with the name of the pad and the frame.
    pad : str
        Name of the pad.
    frame : TaxelFrame
        Assembled taxel frame of the pad.
    """
    for trust in trusts[pad]:
        frame = trust.only_trusted(frame)
    on_frame(pad, frame)


def without_values(frame: TaxelFrame, carriers: Iterable[TpdoLayout | DomainLayout]) -> TaxelFrame:
    """Return the frame with NaN and STALE for all taxels in ``carriers``, whose values cannot be trusted."""
    untrusted, missing = np.zeros(frame.values.shape, bool), frame.missing_can_frames
    for carrier in carriers:
        taxels = tuple(np.array([(field.row, field.col) for field in carrier.taxels], np.intp).reshape(-1, 2).T)
        missing += bool(frame.has_value[taxels].any())
        untrusted[taxels] = True
    return frame.without(untrusted & frame.has_value)._replace(missing_can_frames=missing)
