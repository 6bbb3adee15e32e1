"""Flat planes of an image, padded to full tiles so that kernels need no edge case."""

import numpy as np
import torch
from jaxtyping import Shaped
from torch import Tensor

from diff4splat.render.raster.tables import Floats, Grid


def empty(*shape: int, dtype: torch.dtype = torch.float32) -> np.ndarray:
    """An array that begins on a cache line, as PyTorch's do."""
    return torch.empty(shape, dtype=dtype, device="cpu").numpy()


class PaddedImage:
    """Output planes of blending. Every pixel is written, so they start uninitialised."""

    def __init__(self, grid: Grid, channels: int, medians: bool) -> None:
        self.grid = grid
        self.shape = grid.rows << grid.shift, grid.columns << grid.shift
        pixels = self.shape[0] * self.shape[1]
        self.planes: Floats = empty(channels * pixels)
        self.light: Floats = empty(pixels)
        self.stops: Floats = empty(pixels)
        """How many entries of its tile's list a pixel looked at before it went dark."""
        self.medians = empty(pixels if medians else 0, dtype=torch.int32)

    def padded(self, planes: np.ndarray) -> Shaped[Tensor, "c p q"]:
        """Planes with their padding; shares memory."""
        return torch.from_numpy(planes.reshape(-1, *self.shape))

    def cropped(self, planes: np.ndarray) -> Shaped[Tensor, "c h w"]:
        """Planes without the padding; shares memory."""
        return self.padded(planes)[:, : self.grid.height, : self.grid.width]
