"""Maps to tokens and back: patches in space and packs of four frames in time.

Axes: ``b`` batch, ``c`` channels, ``f`` video frames = 1 + 4 k, ``t h w`` frames, rows and columns
of a grid, ``d`` width of a token. Latent frame i ≥ 1 belongs to the video frames 4i−3 … 4i and
latent frame 0 to video frame 0 alone, so frame 0 is repeated to fill its pack of four.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.models.config.networks import TIME_STRIDE


def patchify(
    maps: Float[Tensor, "b c t h w"], patch: tuple[int, int, int]
) -> Float[Tensor, "b t2 h2 w2 d"]:
    """Cut into blocks of ``patch`` = (t, h, w); a token lists them as (c, t, h, w)."""
    for axis, size in zip((2, 3, 4), patch, strict=True):
        if maps.shape[axis] % size:
            raise ShapeError(
                f"patchify: expected a multiple of {patch} in {tuple(maps.shape[2:])}; pad or crop"
            )
    blocks = (
        maps.unflatten(4, (-1, patch[2])).unflatten(3, (-1, patch[1])).unflatten(2, (-1, patch[0]))
    )
    return blocks.permute(0, 2, 4, 6, 1, 3, 5, 7).flatten(4)


def unpatchify(
    tokens: Float[Tensor, "b t h w d"], patch: tuple[int, int, int]
) -> Float[Tensor, "b c t2 h2 w2"]:
    """Join tokens that list their block as (t, h, w, c), the order of Wan's output layer."""
    blocks = tokens.unflatten(-1, (*patch, -1))
    return blocks.permute(0, 7, 1, 4, 2, 5, 3, 6).flatten(6, 7).flatten(4, 5).flatten(2, 3)


def fill_first_pack(video: Float[Tensor, "b c f h w"]) -> Float[Tensor, "b c f2 h w"]:
    """Repeat frame 0 until 1 + 4 k frames are 4 (1 + k)."""
    frames = video.shape[2]
    if frames % TIME_STRIDE != 1:
        raise ShapeError(
            f"video frames: expected 1 + 4 k, got {frames}; drop or repeat the last ones"
        )
    return torch.cat([video[:, :, :1].expand(-1, -1, TIME_STRIDE - 1, -1, -1), video], 2)


def pack_frames(video: Float[Tensor, "b c f h w"]) -> Float[Tensor, "b c4 t h w"]:
    """Four frames per latent frame as channels, four for each channel (Wan-Fun's order)."""
    packs = fill_first_pack(video).unflatten(2, (-1, TIME_STRIDE))
    return packs.transpose(2, 3).flatten(1, 2)
