"""Define the recogniser's network in PyTorch, and convert its weights to arrays."""

import numpy as np
import torch
from torch import nn

from tactile_node.shape.invariants import COUNT
from tactile_node.shape.network import STRIDE, TAPS
from tactile_node.shape.patch import SIDE

CHANNELS = (2, 24, 48)  #: Number of channels in the images, and after each convolution.
HIDDEN = (128, 64)      #: Number of outputs of each hidden dense layer.


class TorchModel(nn.Module):
    """PyTorch version of tactile_node.shape.network, for training.

    Parameters
    ----------
    middle : np.ndarray
        Mean of the geometry, (COUNT,).
    spread : np.ndarray
        Standard deviation of the geometry, (COUNT,).
    outputs : int
        Number of outputs.
    """

    def __init__(self, middle: np.ndarray, spread: np.ndarray, outputs: int = 6):
        super().__init__()
        self.convolutions = nn.ModuleList(nn.Conv2d(a, b, taps, STRIDE, padding=1)
                                          for a, b, taps in zip(CHANNELS, CHANNELS[1:], TAPS))
        side = SIDE // 4
        sizes = (CHANNELS[-1] * side * side + COUNT, *HIDDEN, outputs)
        self.dense = nn.ModuleList(nn.Linear(a, b) for a, b in zip(sizes, sizes[1:]))
        self.register_buffer('middle', torch.as_tensor(middle))
        self.register_buffer('spread', torch.as_tensor(spread))

    def forward(self, images: torch.Tensor, geometry: torch.Tensor) -> torch.Tensor:
        """Return the logits of K contacts.

        Parameters
        ----------
        images : torch.Tensor
            (K, channels, SIDE, SIDE).
        geometry : torch.Tensor
            (K, COUNT).

        Returns
        -------
        torch.Tensor
            (K, outputs).
        """
        for convolution in self.convolutions:
            images = torch.relu(convolution(images))
        standard = torch.clamp((geometry - self.middle) / self.spread, -5, 5)
        flow = torch.cat((images.flatten(1), standard), 1)
        for layer in self.dense[:-1]:
            flow = torch.relu(layer(flow))
        return self.dense[-1](flow)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights in the layout of network.Network, with the channels last.

        The weights are converted to float16 to keep the file small. The arrays ``middle`` and ``spread`` keep their
        type.
        """
        found = {}
        for layer, convolution in enumerate(self.convolutions):
            weight = convolution.weight.detach().numpy()  # axes: output, input, row, column
            found[f'kernel{layer}'] = weight.transpose(2, 3, 1, 0).reshape(-1, weight.shape[0])
            found[f'bias{layer}'] = convolution.bias.detach().numpy()
        for layer, dense in enumerate(self.dense, len(self.convolutions)):
            weight = dense.weight.detach().numpy()
            found[f'kernel{layer}'] = (_channels_last(weight) if layer == len(self.convolutions) else weight).T
            found[f'bias{layer}'] = dense.bias.detach().numpy()
        found = {name: np.ascontiguousarray(array, np.float16) for name, array in found.items()}
        return found | {'middle': self.middle.numpy(), 'spread': self.spread.numpy()}


def _channels_last(weight: np.ndarray) -> np.ndarray:
    """Reorder the inputs of the first dense layer from (channel, row, column) to (row, column, channel)."""
    channels, side = CHANNELS[-1], SIDE // 4
    image = weight[:, :-COUNT].reshape(-1, channels, side, side).transpose(0, 2, 3, 1)
    return np.concatenate((image.reshape(len(weight), -1), weight[:, -COUNT:]), 1)
