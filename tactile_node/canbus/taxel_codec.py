"""Payloads of a pad's TPDOs <-> taxel values, all taxels at once."""

from collections.abc import Iterable

import numpy as np

from tactile_node.canbus.layout import SkinLayout, TpdoLayout
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus


class TaxelCodec:
    """Precomputed index arrays of a layout; ``payload`` is 8 bytes for each TPDO, in the layout's order.

    >>> from tactile_node.canbus.layout_file import load_layout
    >>> codec = TaxelCodec(load_layout('sim16x16.yaml'))
    >>> values, status = codec.decode(bytes(8 * 32), np.ones(32, bool))
    >>> values.shape, float(values.max())
    ((16, 16), 0.0)
    """

    def __init__(self, layout: SkinLayout):
        fields = [(rank, field) for rank, tpdo in enumerate(layout.tpdos) for field in tpdo.taxels]
        bits, big = layout.value.bits, layout.value.byte_order == 'big'
        starts = np.array([f.start_bit for _, f in fields], np.uint64)
        self._shape, self._value = (layout.rows, layout.cols), layout.value
        self._rank = np.array([rank for rank, _ in fields], np.intp)
        self._shift = np.uint64(64 - bits) - starts if big else starts
        self._taxel = np.array([f.row * layout.cols + f.col for _, f in fields], np.intp)
        self._mask = np.uint64((1 << bits) - 1)
        self._word = np.dtype('>u8' if big else '<u8')
        self._ranks = len(layout.tpdos)
        self._unmapped = np.full(layout.rows * layout.cols, TaxelStatus.UNMAPPED, np.uint8)
        dead = np.zeros(self._shape, bool)
        for row, col in layout.dead:
            dead[row, col] = True
        self._dead = dead.ravel()

    def decode(self, payload: bytes | bytearray, fresh: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return values (float32) and status (uint8), both (rows, cols) and read-only.

        ``fresh``, shape (TPDOs,), says which payloads belong to this period; the rest is NaN and STALE.
        """
        counts = self._counts(payload)
        state = np.where(fresh[self._rank], TaxelStatus.VALID, TaxelStatus.STALE)
        if self._value.saturated_count is not None:
            at_end = counts == self._value.saturated_count
            state[at_end & (state == TaxelStatus.VALID)] = TaxelStatus.SATURATED
        status = self._unmapped.copy()
        status[self._taxel] = state
        status[self._dead] = TaxelStatus.DEAD
        values = np.full(status.shape, np.nan, np.float32)
        values[self._taxel] = self._value.to_value(counts)
        values[(status != TaxelStatus.VALID) & (status != TaxelStatus.SATURATED)] = np.nan
        return _read_only(values.reshape(self._shape)), _read_only(status.reshape(self._shape))

    def _counts(self, payload: bytes | bytearray) -> np.ndarray:
        words = np.frombuffer(payload, self._word).astype(np.uint64)
        counts = ((words[self._rank] >> self._shift) & self._mask).astype(np.int64)
        if self._value.signed:
            counts -= (counts >> (self._value.bits - 1)) << self._value.bits
        return counts

    def encode(self, values: np.ndarray) -> bytes:
        """The inverse: values (rows, cols) in the layout's unit -> payload, as the device sends it."""
        counts = self._value.to_counts(np.asarray(values).reshape(-1)[self._taxel])
        fields = (counts.astype(np.uint64) & self._mask) << self._shift
        words = np.zeros(self._ranks, np.uint64)
        np.bitwise_or.at(words, self._rank, fields)
        return words.astype(self._word).tobytes()


def _read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


def without_values(frame: TaxelFrame, tpdos: Iterable[TpdoLayout]) -> TaxelFrame:
    """The frame with NaN and STALE in place of what ``tpdos`` brought: their meaning is not known."""
    values, status, missing = frame.values.copy(), frame.status.copy(), frame.missing_can_frames
    for tpdo in tpdos:
        taxels = tuple(np.array([(field.row, field.col) for field in tpdo.taxels], np.intp).reshape(-1, 2).T)
        given = np.isin(status[taxels], (TaxelStatus.VALID, TaxelStatus.SATURATED))
        missing += bool(given.any())
        status[taxels] = np.where(given, np.uint8(TaxelStatus.STALE), status[taxels])
        values[taxels] = np.nan
    return frame._replace(values=_read_only(values), status=_read_only(status), missing_can_frames=missing)
