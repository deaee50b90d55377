"""Convert the payloads of a pad's TPDOs or DOMAIN into taxel values and back, for all taxels at once."""

import numpy as np

from tactile_node.cia301.objects import MAX_PDO_BYTES
from tactile_node.skin.layout import SkinLayout
from tactile_node.taxel_frame import TaxelStatus, read_only

# NumPy handles its own scalars several times faster than members of an enumeration.
VALID = np.uint8(TaxelStatus.VALID)
STALE = np.uint8(TaxelStatus.STALE)
SATURATED = np.uint8(TaxelStatus.SATURATED)


class TaxelCodec:
    """Converts between payloads and taxel values with precomputed index arrays.

    A payload has 8 bytes for each TPDO, in layout order. The payload of a DOMAIN is the content of the object.

    Parameters
    ----------
    layout
        Layout of the pad.

    Examples
    --------

    >>> from tactile_node.skin.layout_file import load_layout
    >>> codec = TaxelCodec(load_layout('sim16x16.yaml'))
    >>> values, status = codec.decode(bytes(8 * 32), np.ones(32, bool))
    >>> values.shape, float(values.max())
    ((16, 16), 0.0)
    """

    def __init__(self, layout: SkinLayout):
        fields = [(rank, field) for rank, carrier in enumerate(layout.carriers) for field in carrier.taxels]
        bits, big = layout.value.bits, layout.value.byte_order == 'big'
        starts = np.array([8 * MAX_PDO_BYTES * rank + field.start_bit for rank, field in fields], np.intp)
        self._shape = layout.rows, layout.cols
        self._value = layout.value
        self._rank = np.array([rank for rank, _ in fields], np.intp)
        self._first = starts // 8  # first byte of each field; a field spans at most 8 bytes
        bit = (starts % 8).astype(np.uint64)
        self._shift = np.uint64(64 - bits) - bit if big else bit
        self._taxel = np.array([f.row * layout.cols + f.col for _, f in fields], np.intp)
        self._mask = np.uint64((1 << bits) - 1)
        self._word = np.dtype('>u8' if big else '<u8')
        self.payload_bytes = MAX_PDO_BYTES * len(layout.tpdos) if layout.domain is None else layout.domain.length
        self._unmapped = np.full(layout.rows * layout.cols, TaxelStatus.UNMAPPED, np.uint8)
        dead = np.zeros(self._shape, bool)
        for row, col in layout.dead:
            dead[row, col] = True
        self._dead = np.flatnonzero(dead)
        self._saturated_count = layout.value.saturated_count

    def decode(self, payload: bytes | bytearray, fresh: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the taxel values and their status.

        Parameters
        ----------
        payload
            Payloads of all TPDOs, or of the DOMAIN.
        fresh
            Shape (TPDOs,), True for each TPDO whose payload belongs to the current period. Taxels in all other TPDOs
            get the value NaN and the status STALE.

        Returns
        -------
        values
            Shape (rows, cols), float32, in the layout's unit, read-only.
        status
            Shape (rows, cols), uint8, `TaxelStatus`, read-only.
        """
        counts = self._counts(payload)
        is_given = fresh[self._rank]
        state = np.where(is_given, VALID, STALE)
        if self._saturated_count is not None:
            state[is_given & (counts == self._saturated_count)] = SATURATED
        status = self._unmapped.copy()
        status[self._taxel] = state
        status[self._dead] = TaxelStatus.DEAD
        values = np.full(status.shape, np.nan, np.float32)
        values[self._taxel] = np.where(is_given, self._value.to_value(counts), np.float32(np.nan))
        values[self._dead] = np.nan
        return read_only(values.reshape(self._shape)), read_only(status.reshape(self._shape))

    def _counts(self, payload: bytes | bytearray) -> np.ndarray:
        padded = np.frombuffer(bytes(payload) + bytes(8), np.uint8)
        words = np.ndarray(len(padded) - 7, self._word, padded, strides=(1,))[self._first].astype(np.uint64)
        counts = ((words >> self._shift) & self._mask).astype(np.int64)
        if self._value.signed:
            counts -= (counts >> (self._value.bits - 1)) << self._value.bits
        return counts

    def encode(self, values: np.ndarray) -> bytes:
        """Return the payload that the device would send for ``values``.

        Parameters
        ----------
        values
            Shape (rows, cols), in the layout's unit.
        """
        counts = self._value.to_counts(np.asarray(values).reshape(-1)[self._taxel])
        fields = (counts.astype(np.uint64) & self._mask) << self._shift
        parts = fields.astype(self._word).view(np.uint8).reshape(-1, 8)
        payload = np.zeros(self.payload_bytes + 8, np.uint8)
        np.bitwise_or.at(payload, self._first[:, np.newaxis] + np.arange(8), parts)
        return payload[:-8].tobytes()
