"""Parameter-free shortcuts of Wan 2.2's autoencoder around a whole resolution.

Axes: ``b`` batch, ``c`` channels, ``t h w`` frames, rows and columns; ``factor`` = (frames, pixels)
per side that become one.
"""

import torch
from jaxtyping import Float
from torch import Tensor


def average_down(
    frames: Float[Tensor, "b c t h w"], out_channels: int, factor: tuple[int, int]
) -> Float[Tensor, "b c2 t2 h2 w2"]:
    """Blocks become channels, and groups of those their mean; zeros fill the first block."""
    in_time, in_space = factor
    missing = -frames.shape[2] % in_time
    frames = torch.nn.functional.pad(frames, (0, 0, 0, 0, missing, 0))
    blocks = frames.unflatten(4, (-1, in_space)).unflatten(3, (-1, in_space))
    blocks = blocks.unflatten(2, (-1, in_time)).permute(0, 1, 3, 5, 7, 2, 4, 6)
    return blocks.flatten(1, 4).unflatten(1, (out_channels, -1)).mean(2)


def duplicate_up(
    frames: Float[Tensor, "b c t h w"],
    out_channels: int,
    factor: tuple[int, int],
    starts: bool,
) -> Float[Tensor, "b c2 t2 h2 w2"]:
    """Channels, repeated, become blocks; frame 0 becomes one frame."""
    in_time, in_space = factor
    repeats = out_channels * in_time * in_space**2 // frames.shape[1]
    blocks = frames.repeat_interleave(repeats, 1)
    blocks = blocks.unflatten(1, (out_channels, in_time, in_space, in_space))
    blocks = blocks.permute(0, 1, 5, 2, 6, 3, 7, 4)
    grown = blocks.flatten(6, 7).flatten(4, 5).flatten(2, 3)
    return grown[:, :, in_time - 1 :] if starts else grown
