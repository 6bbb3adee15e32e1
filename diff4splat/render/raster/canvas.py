"""Flat planes of a picture, padded to whole tiles so that no kernel meets an edge."""

import numpy as np
import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from diff4splat.render.raster.tables import Floats, Grid


def empty(*shape: int, dtype: torch.dtype = torch.float32) -> np.ndarray:
    """An array that begins on a cache line, as PyTorch's do."""
    return torch.empty(shape, dtype=dtype).numpy()


class Canvas:
    """What blending writes. Every pixel of it is written, so it starts with any content."""

    def __init__(self, grid: Grid, channels: int, medians: bool) -> None:
        self.grid = grid
        self.shape = grid.rows << grid.shift, grid.columns << grid.shift
        pixels = self.shape[0] * self.shape[1]
        self.planes: Floats = empty(channels * pixels)
        self.light: Floats = empty(pixels)
        self.stops: Floats = empty(pixels)
        """How many entries of its tile's list a pixel looked at before it went dark."""
        self.medians = empty(pixels if medians else 0, dtype=torch.int32)

    def pictures(self, planes: np.ndarray) -> Shaped[Tensor, "c h w"]:
        """Planes without the padding; shares memory."""
        whole = torch.from_numpy(planes).view(-1, *self.shape)
        return whole[:, : self.grid.height, : self.grid.width]

    def padded(self, planes: Float[Tensor, "c h w"], light: Float[Tensor, "h w"]) -> Floats:
        """Gradients of all planes, then of the light, with zeros where nothing was asked for."""
        channels = len(self.planes) // len(self.light)
        whole = torch.zeros(channels + 1, *self.shape)
        height, width = self.grid.height, self.grid.width
        whole[: len(planes), :height, :width] = planes
        whole[-1, :height, :width] = light
        return whole.flatten().numpy()
