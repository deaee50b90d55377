"""Makes one taxel frame of each SDO upload of a pad's DOMAIN; what ``assembler`` is for TPDOs.

A period begins with the request of an upload, whoever sends it, and ends with the next one. An upload that did
not succeed gives, at that next one, a frame whose taxels are all NaN and STALE, or none (``drop_incomplete``).
"""

from collections import Counter

import numpy as np

from tactile_node.cia301.connection_set import SDO_REQUEST, SDO_RESPONSE
from tactile_node.cia301.sdo_upload import SdoUpload, Step
from tactile_node.frames.losses import Loss, LossReason, PadStatistics, Results
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.taxel_codec import TaxelCodec


class DomainAssembler:
    """The state machine of one polled pad; counts are of uploads where ``FrameAssembler``'s are of TPDOs."""

    service = 'sdo'  #: of its CAN frames, for the counts

    def __init__(self, layout: SkinLayout, node_id: int, drop_incomplete: bool = False):
        self._codec, self.drop_incomplete = TaxelCodec(layout), drop_incomplete
        self._upload = SdoUpload(layout.domain.index, layout.domain.subindex)
        self._request_id, self._response_id = SDO_REQUEST + node_id, SDO_RESPONSE + node_id
        self._counts: Counter[str] = Counter()
        self._losses: Counter[LossReason] = Counter()
        self._stamp: float | None = None
        self.restart()

    @property
    def can_ids(self) -> frozenset[int]:
        return frozenset((self._request_id, self._response_id))

    def restart(self) -> None:
        """Forget the upload under way; the next request is number 0."""
        self._sequence = -1
        self.resume(0)

    def resume(self, lost_periods: int) -> None:
        """Forget the upload under way; the next request comes ``lost_periods`` numbers later than the next one."""
        if self._stamp is not None and self._upload.is_under_way:
            self._losses[LossReason.UNFINISHED] += 1
        self._sequence, self._stamp = self._sequence + lost_periods, None

    def start(self, node_id: int) -> None:
        """A polled pad sends nothing of its own."""

    def sync(self, timestamp: float) -> Results:
        """SYNC means nothing to a polled pad."""
        return ()

    def feed(self, can_id: int, data: bytes, timestamp: float) -> Results:
        """One frame of the SDO channel: the taxel frame that it completes or ends, a loss, or nothing."""
        if can_id == self._response_id:
            return self._take(self._upload.response(data))
        step = self._upload.request(data)
        if step is not Step.BEGUN:
            return self._take(step)
        ended = self.end_period()
        self._sequence, self._stamp = self._sequence + 1, timestamp
        return ended

    def end_period(self) -> Results:
        """No more of this upload will come; the frame without values, if it has not succeeded."""
        return () if self._stamp is None else self._give(b'', False)

    def statistics(self) -> PadStatistics:
        counts = self._counts
        expected = counts['complete'] + counts['incomplete'] + counts['withheld']
        return PadStatistics(
            counts['complete'], counts['incomplete'], expected, counts['complete'] + sum(self._losses.values()),
            counts['complete'], 0, {reason: self._losses[reason] for reason in LossReason}, counts['withheld'],
            (counts['complete'],))

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
        return self._give(data, True)

    def _give(self, data: bytes, is_fresh: bool) -> Results:
        stamp, self._stamp = self._stamp, None
        if not is_fresh and self.drop_incomplete:
            self._counts['withheld'] += 1
            return ()
        self._counts['complete' if is_fresh else 'incomplete'] += 1
        payload = data if is_fresh else bytes(self._codec.payload_bytes)
        values, status = self._codec.decode(payload, np.array([is_fresh]))
        return (TaxelFrame(stamp, self._sequence, values, status, 0 if is_fresh else 1),)

    def _lose(self, reason: LossReason) -> Results:
        self._losses[reason] += 1
        return (Loss(reason),)
