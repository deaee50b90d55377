"""Evaluate a small convolutional network with NumPy alone.

The network has two rectified convolutions, the first with 4x4 taps and the second with 3x3 taps. Each convolution
halves the number of rows and columns. The output of the convolutions and the geometry pass through dense layers, which
are rectified except for the last one. training/train.py trains the network.
"""

from typing import NamedTuple

import numpy as np

STRIDE = 2
TAPS = (4, 3)


class Network(NamedTuple):
    """Weights of the network, float32.

    A convolution has the shape (taps² · in, out), with its taps row by row. A dense layer has the shape (in, out).
    """

    kernels: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    middle: np.ndarray  #: subtracted from the geometry, (COUNT,)
    spread: np.ndarray  #: divisor of (geometry - middle), (COUNT,)

    def embedding(self, images: np.ndarray, geometry: np.ndarray) -> np.ndarray:
        """Return the input of the last layer, followed by the standardised geometry.

        Parameters
        ----------
        images : np.ndarray
            Images of K contacts, (K, rows, cols, channels).
        geometry : np.ndarray
            (K, COUNT).

        Returns
        -------
        np.ndarray
            float32 (K, width).
        """
        for kernel, bias, taps in zip(self.kernels, self.biases, TAPS):
            images = _convolved(images, kernel, bias, taps)
        standard = np.minimum(np.maximum((geometry - self.middle) / self.spread, -5), 5)
        flow = np.concatenate((images.reshape(len(images), -1), standard), 1, dtype=np.float32)
        for weight, bias in list(zip(self.kernels, self.biases))[len(TAPS):-1]:
            flow = np.maximum(flow @ weight + bias, 0)
        return np.concatenate((flow, standard), 1, dtype=np.float32)

    def logits(self, embedding: np.ndarray) -> np.ndarray:
        """Return the logits, (K, outputs), for an embedding."""
        return embedding[:, :len(self.kernels[-1])] @ self.kernels[-1] + self.biases[-1]

    @property
    def width(self) -> int:
        """Number of columns of an embedding."""
        return len(self.kernels[-1]) + len(self.middle)


def _convolved(images: np.ndarray, kernel: np.ndarray, bias: np.ndarray, taps: int) -> np.ndarray:
    """Return the rectified convolution of ``images``, which are padded with one cell of zeros."""
    count, rows, cols, channels = images.shape
    padded = np.zeros((count, rows + 2, cols + 2, channels), np.float32)
    padded[:, 1:-1, 1:-1] = images
    high, wide = ((size + 2 - taps) // STRIDE + 1 for size in (rows, cols))
    k, r, c, one = padded.strides
    windows = np.ndarray((count, high, wide, taps, taps, channels), np.float32, padded,  # as_strided takes 10 us longer
                         strides=(k, r * STRIDE, c * STRIDE, r, c, one))
    out: np.ndarray = windows.reshape(count * high * wide, taps * taps * channels) @ kernel
    out += bias
    np.maximum(out, 0, out=out)
    return out.reshape(count, high, wide, -1)
