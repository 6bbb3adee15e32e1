"""Frames and tokens where a token may cover two frames.

Axes: ``b`` batch, ``c`` channels, ``t h w`` frames, rows and columns, ``d`` width of a token.
Frames that fill the first token up are copies of the first frame, before it (CogVideoX 1.5).
"""

import torch
from jaxtyping import Float
from torch import Tensor


def repeat_first_frame(frames: Float[Tensor, "..."], patch_frames: int, axis: int = 2) -> Tensor:
    """The first frame as often as it takes to a multiple of ``patch_frames`` along ``axis``."""
    missing = -frames.shape[axis] % patch_frames
    if not missing:
        return frames
    return torch.cat([frames.narrow(axis, 0, 1)] * missing + [frames], axis)


def merge_frames(
    tokens: Float[Tensor, "b t h w d"], patch_frames: int
) -> Float[Tensor, "b t2 h w d"]:
    """Means over the frames of each token."""
    if patch_frames == 1:
        return tokens
    return repeat_first_frame(tokens, patch_frames, axis=1).unflatten(1, (-1, patch_frames)).mean(2)


def join_patches(
    tokens: Float[Tensor, "b t h w d"], patch: tuple[int, int, int]
) -> Float[Tensor, "b c t2 h2 w2"]:
    """Join tokens that list their block as (c, t, h, w), the order of CogVideoX's output layer."""
    blocks = tokens.unflatten(-1, (-1, *patch))
    return blocks.permute(0, 4, 1, 5, 2, 6, 3, 7).flatten(6, 7).flatten(4, 5).flatten(2, 3)
