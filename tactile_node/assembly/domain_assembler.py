"""Assemble each SDO upload of a pad's DOMAIN into one taxel frame.

The assembler is a pure state machine without access to a bus or a clock.

A period begins when any client requests an upload, and ends at the next request. If the upload has not succeeded by
then, the assembler emits a frame whose taxels are all NaN and STALE. With ``drop_incomplete``, the assembler emits no
frame for a failed upload.
"""

import numpy as np

from tactile_node.assembly.facts import LossReason
from tactile_node.assembly.pad_assembler import PadAssembler, TaxelFrames
from tactile_node.cia301.objects import SDO_REQUEST, SDO_RESPONSE
from tactile_node.cia301.sdo import SdoUpload, UploadStep
from tactile_node.skin.layout import DomainLayout, SkinLayout


class DomainAssembler(PadAssembler):
    """The state machine of one polled pad. The counts of a polled pad refer to uploads, not to TPDOs.

    Parameters
    ----------
    layout : SkinLayout
        Layout of the pad.
    domain : DomainLayout
        Object to poll.
    node_id : int
        Node-ID of the device.
    """

    service = 'sdo'

    def __init__(self, layout: SkinLayout, domain: DomainLayout, node_id: int):
        super().__init__(layout, (node_id,))
        self._upload = SdoUpload(domain.index, domain.subindex)
        self._response_id = SDO_RESPONSE + node_id
        self.can_ids = frozenset((SDO_REQUEST + node_id, self._response_id))
        self._stamp: float | None = None  # stamp at which the present period began
        self.restart()

    def feed(self, can_id: int, data: bytes, stamp: float) -> TaxelFrames:
        if can_id == self._response_id:
            return self._take(self._upload.response(data))
        step = self._upload.request(data)
        if step is not UploadStep.BEGUN:
            return self._take(step)
        frames = self.end_period()
        self._sequence += 1
        self._stamp = stamp
        return frames

    def end_period(self) -> TaxelFrames:
        """End the present upload. Return a frame without values if the upload has not succeeded."""
        return self._end(bytes(self._codec.payload_bytes), is_fresh=False)

    def _forget(self) -> None:
        if self._stamp is not None and self._upload.is_under_way:
            self._lose_upload(LossReason.UNFINISHED)
        self._stamp = None

    def _take(self, step: UploadStep) -> TaxelFrames:
        if self._stamp is None:
            return ()
        if step is UploadStep.BROKEN:
            return self._lose_upload(LossReason.BROKEN)
        if step is not UploadStep.DONE:
            return ()
        data, wanted = self._upload.data, self._codec.payload_bytes
        if len(data) != wanted:
            return self._lose_upload(LossReason.SHORT if len(data) < wanted else LossReason.OVER_LONG)
        self._received += 1
        return self._end(data, is_fresh=True)

    def _end(self, payload: bytes, is_fresh: bool) -> TaxelFrames:
        if self._stamp is None:
            return ()
        stamp, self._stamp = self._stamp, None
        return self._emit_or_withhold(stamp, self._sequence, payload, np.array([is_fresh]))

    def _lose_upload(self, reason: LossReason) -> TaxelFrames:
        self._received += 1
        return self._lose(reason)
