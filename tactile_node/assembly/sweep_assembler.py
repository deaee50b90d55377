"""Recognise the sweeps of a skin that sends without SYNC.

The assembler is a pure state machine without access to a bus or a clock. The device sends all TPDOs of one scan
together, in ascending rank. The next sweep begins at least one ``period`` later. CAN preserves the order of each
sender's frames.

The assembler follows these rules:

 1. A taxel frame consists of one run. A run consists of TPDOs in ascending rank, stamped within ``sweep_time`` of the
    first TPDO.

 2. If the rank of a TPDO is not above the last rank, or its stamp is not within ``sweep_time``, the TPDO begins the
    next run. A TPDO that repeats the previous TPDO byte for byte within ``sweep_time`` is a DUPLICATE and changes
    nothing.

 3. A run is emitted when its last rank is received, or when the next run begins. Taxels without a TPDO in the run are
    NaN and STALE. With ``drop_incomplete``, an incomplete frame is withheld.

 4. The stamp of a frame is the stamp of the first TPDO received. This stamp is later than the scan by the time that the
    device takes to send the TPDO. If the first TPDOs of a sweep are lost, the stamp is later by up to ``sweep_time``.

 5. If the device has an event timer, ``sequence`` also counts the sweeps missed during a pause. After SILENCE
    missing sweeps, TPDOs may have waited in an adapter. These TPDOs are LATE until a run begins more than
    ``sweep_time`` after the previous run.

Two sweeps are never mixed if each sweep takes less than ``sweep_time`` from its beginning to its last stamp. Under this
condition, the first TPDO received is stamped at most ``sweep_time`` after the beginning of the sweep, and the run ends
``sweep_time`` later. The sum of both times is shorter than the period (``SWEEP_SHARE``).

As an exception, two sweeps may be mixed if two faults coincide. The first fault is a longer delay of the stamps, for
example by an adapter that delivers many frames at once. The second fault is the loss of both the end of one sweep and
the beginning of the next.
"""

from collections.abc import Sequence

import numpy as np

from tactile_node.assembly.facts import LossReason
from tactile_node.assembly.pad_assembler import PadAssembler, TaxelFrames
from tactile_node.cia301.objects import MAX_PDO_BYTES
from tactile_node.skin.layout import EventDriven, SkinLayout

#: Number of event timer intervals without a TPDO that count as silence. TPDOs lost from a working device cause shorter
#: gaps.
SILENCE = 5


class SweepAssembler(PadAssembler):
    """The state machine of one pad that sends whole sweeps without SYNC.

    The arguments are those of `PadAssembler`, and ``event``, the timing of the pad's transmissions.
    """

    def __init__(self, layout: SkinLayout, event: EventDriven, node_ids: Sequence[int]):
        super().__init__(layout, node_ids)
        self._event = event
        self._size = len(layout.tpdos)
        self._first: float | None = None  # stamp of the first TPDO in the run
        self._words = bytearray()
        self._fresh = np.zeros(self._size, bool)
        self._is_emitted = True  # True if the run was emitted or no run has begun
        self._last = -1, b''  # rank and bytes of the last TPDO
        self.restart()

    def node_started(self, node_id: int) -> None:
        """Record that the node was started. The next TPDO of the node begins a run."""
        self._is_continued = False

    def end_period(self) -> TaxelFrames:
        frames, self._first = self._end(), None
        return frames

    def _feed_tpdo(self, rank: int, data: bytes, stamp: float) -> TaxelFrames:
        is_within = self._is_within(stamp)
        if is_within and (rank, data) == self._last:
            return self._lose(LossReason.DUPLICATE)
        frames: TaxelFrames = ()
        if not is_within or rank <= self._last[0]:
            frames = self._end()
            self._begin(stamp)
        self._last = rank, data
        if wrong := self._wrong_length(rank, data):
            self._lose(wrong)
        else:
            self._words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * rank + len(data)] = data
            self._fresh[rank] = True
        return frames + self._end() if rank == self._size - 1 else frames

    def _pending(self) -> int:
        return 0 if self._is_emitted else int(self._fresh.sum())

    def _forget(self) -> None:
        self._lose(LossReason.UNFINISHED, self._pending())
        self._first = None
        self._is_emitted = True
        self._is_continued = False  # True if the next TPDO may belong to the present run
        self._is_held_back = False  # True if the run may have waited in an adapter
        self._last = -1, b''

    def _is_within(self, stamp: float) -> bool:
        """Return True if a TPDO with this stamp may belong to the present run."""
        return (self._is_continued and self._first is not None
                and 0 <= stamp - self._first <= self._event.sweep_time)

    def _begin(self, stamp: float) -> None:
        timer, steps = self._event.event_timer, 1
        if timer and self._first is not None:
            pause = stamp - self._first
            steps = max(1, int(pause / timer + 0.5))
            is_backlog = 0 <= pause <= self._event.sweep_time  # no device begins a sweep so soon after the previous one
            self._is_held_back = is_backlog if self._is_held_back else pause > SILENCE * timer
        self._sequence += steps
        self._first = stamp
        self._words = bytearray(MAX_PDO_BYTES * self._size)
        self._fresh = np.zeros(self._size, bool)
        self._is_continued, self._is_emitted = True, False

    def _end(self) -> TaxelFrames:
        """Return the frame of the present run, if there is one."""
        if self._is_emitted or self._first is None:
            return ()
        self._is_emitted = True
        if self._is_held_back:
            return self._lose(LossReason.LATE, int(self._fresh.sum()))
        return self._emit_or_withhold(self._first, self._sequence, self._words, self._fresh)
