"""A small convolutional network, evaluated with numpy alone.

Two convolutions, rectified, each of which halves rows and columns (taps 4x4, then 3x3); their output
joined with the geometry; dense layers, rectified but the last. Trained by training/train.py.
"""

from typing import NamedTuple

import numpy as np

STRIDE = 2
TAPS = (4, 3)


class Network(NamedTuple):
    """Weights, float32: convolutions (taps²·in, out), taps row by row, dense layers (in, out)."""

    kernels: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    middle: np.ndarray   #: (COUNT,) and
    spread: np.ndarray   #: (COUNT,): geometry is used as (geometry - middle) / spread

    def embedding(self, images: np.ndarray, geometry: np.ndarray) -> np.ndarray:
        """Return what the last layer sees, (K, last width), and after it the standard geometry, (K, COUNT), float32.

        ``images`` (K, rows, cols, channels), ``geometry`` (K, COUNT).
        """
        for kernel, bias, taps in zip(self.kernels, self.biases, TAPS):
            images = _convolved(images, kernel, bias, taps)
        standard = np.minimum(np.maximum((geometry - self.middle) / self.spread, -5), 5)
        flow = np.concatenate((images.reshape(len(images), -1), standard), 1, dtype=np.float32)
        for weight, bias in list(zip(self.kernels, self.biases))[len(TAPS):-1]:
            flow = np.maximum(flow @ weight + bias, 0)
        return np.concatenate((flow, standard), 1, dtype=np.float32)

    def logits(self, embedding: np.ndarray) -> np.ndarray:
        """Return the logits, (K, outputs), of an embedding."""
        return embedding[:, :len(self.kernels[-1])] @ self.kernels[-1] + self.biases[-1]

    @property
    def width(self) -> int:
        """Columns of an embedding."""
        return len(self.kernels[-1]) + len(self.middle)


def _convolved(images: np.ndarray, kernel: np.ndarray, bias: np.ndarray, taps: int) -> np.ndarray:
    """One cell of zeros around; rectified."""
    count, rows, cols, channels = images.shape
    padded = np.zeros((count, rows + 2, cols + 2, channels), np.float32)
    padded[:, 1:-1, 1:-1] = images
    high, wide = ((size + 2 - taps) // STRIDE + 1 for size in (rows, cols))
    k, r, c, one = padded.strides
    windows = np.ndarray((count, high, wide, taps, taps, channels), np.float32, padded,  # as_strided takes 10 us more
                         strides=(k, r * STRIDE, c * STRIDE, r, c, one))
    out: np.ndarray = windows.reshape(count * high * wide, taps * taps * channels) @ kernel
    out += bias
    np.maximum(out, 0, out=out)
    return out.reshape(count, high, wide, -1)
