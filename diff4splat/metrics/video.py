"""Measures of a video as a whole.

Axes: ``*b`` videos, ``t`` frames, ``h w`` pixels, ``c`` colours. RGB in [0, 1].
"""

from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.metrics.image import psnr


def loop_closure_psnr(video: Float[Tensor, "*b t h w c"]) -> Float[Tensor, "*b"]:
    """PSNR in dB of the last frame against the first, for a camera that returns to its start.

    Raises:
        ShapeError: fewer than two frames, or no pixel.
    """
    _require_frames(video)
    return psnr(video[..., -1, :, :, :], video[..., 0, :, :, :])


def _require_frames(video: Tensor) -> None:
    if video.ndim < 4 or video.shape[-4] < 2 or 0 in video.shape[-3:]:
        raise ShapeError(
            f"video: expected t h w c with two frames and a pixel, got {tuple(video.shape)}"
        )
