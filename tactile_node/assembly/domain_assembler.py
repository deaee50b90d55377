"""Makes one taxel frame of each SDO upload of a pad's DOMAIN, as ``assembler`` does of TPDOs.

A period begins with the request of an upload, by any client, and ends with the next one. An upload that did not
succeed gives, at that next one, a frame whose taxels are all NaN and STALE, or none (``drop_incomplete``).
"""


import numpy as np

from tactile_node.assembly.frame_source import Loss, LossReason, PadStatistics, Results
from tactile_node.cia301.objects import SDO_REQUEST, SDO_RESPONSE
from tactile_node.cia301.sdo import SdoUpload, Step
from tactile_node.errors import ConfigurationError
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.taxel_codec import TaxelCodec
from tactile_node.taxel_frame import TaxelFrame


class DomainAssembler:
    """The state machine of one polled pad; counts are of uploads where ``FrameAssembler``'s are of TPDOs.

    Raises ConfigurationError for a layout without a DOMAIN.
    """

    service = 'sdo'  #: under which its CAN frames are counted

    def __init__(self, layout: SkinLayout, node_id: int, drop_incomplete: bool = False):
        if layout.domain is None:
            raise ConfigurationError(layout.source, expected='the key "domain"', got='no such key',
                                     remedy='Use FrameAssembler for a pad with TPDOs.')
        self.drop_incomplete = drop_incomplete
        self._codec = TaxelCodec(layout)
        self._upload = SdoUpload(layout.domain.index, layout.domain.subindex)
        self._request_id = SDO_REQUEST + node_id
        self._response_id = SDO_RESPONSE + node_id
        self._complete = 0
        self._incomplete = 0
        self._withheld = 0
        self._losses = dict.fromkeys(LossReason, 0)
        self._stamp: float | None = None  # of the period under way
        self.restart()

    @property
    def can_ids(self) -> frozenset[int]:
        return frozenset((self._request_id, self._response_id))

    def restart(self) -> None:
        """Forget the upload under way; the next request is number 0."""
        self._sequence = -1
        self.resume(0)

    def resume(self, lost_periods: int) -> None:
        """Forget the upload under way and leave out ``lost_periods`` sequence numbers."""
        if self._stamp is not None and self._upload.is_under_way:
            self._losses[LossReason.UNFINISHED] += 1
        self._sequence += lost_periods
        self._stamp = None

    def start(self, node_id: int) -> None:
        """Has no effect: a polled pad sends nothing unless it is asked."""

    def sync(self, timestamp: float) -> Results:
        """Has no effect: a polled pad does not use SYNC."""
        return ()

    def feed(self, can_id: int, data: bytes, timestamp: float) -> Results:
        """One frame of the SDO channel: the taxel frame that it completes or ends, a loss, or nothing."""
        if can_id == self._response_id:
            return self._take(self._upload.response(data))
        step = self._upload.request(data)
        if step is not Step.BEGUN:
            return self._take(step)
        results = self.end_period()
        self._sequence += 1
        self._stamp = timestamp
        return results

    def end_period(self) -> Results:
        """End the upload under way; the frame without values, if it has not succeeded."""
        if self._stamp is None:
            return ()
        stamp, self._stamp = self._stamp, None
        if self.drop_incomplete:
            self._withheld += 1
            return ()
        self._incomplete += 1
        return self._frame(stamp, bytes(self._codec.payload_bytes), is_fresh=False)

    def statistics(self) -> PadStatistics:
        return PadStatistics(
            complete=self._complete, incomplete=self._incomplete,
            expected=self._complete + self._incomplete + self._withheld,
            received=self._complete + sum(self._losses.values()), used=self._complete, pending=0,
            losses=dict(self._losses), withheld=self._withheld,
            used_by_node=(self._complete,))

    def _take(self, step: Step) -> Results:
        if self._stamp is None:
            return ()
        if step is Step.BROKEN:
            return self._lose(LossReason.BROKEN)
        if step is not Step.DONE:
            return ()
        data, wanted = self._upload.data, self._codec.payload_bytes
        if len(data) != wanted:
            return self._lose(LossReason.SHORT if len(data) < wanted else LossReason.OVER_LONG)
        stamp, self._stamp = self._stamp, None
        self._complete += 1
        return self._frame(stamp, data, is_fresh=True)

    def _frame(self, stamp: float, payload: bytes, is_fresh: bool) -> Results:
        values, status = self._codec.decode(payload, np.array([is_fresh]))
        return (TaxelFrame(stamp, self._sequence, values, status, missing_can_frames=0 if is_fresh else 1),)

    def _lose(self, reason: LossReason) -> Results:
        self._losses[reason] += 1
        return (Loss(reason),)
