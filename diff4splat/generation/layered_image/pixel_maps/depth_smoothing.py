"""Depth without the steps of the cells that it was predicted in.

Axes: ``h w`` pixels, ``t`` latent frames. The depth prior sees a smaller copy of the image. Its
cells stay visible in upsampled depth as blocks, which tear when the camera moves. A fast global
smoother (Min et al. 2014) takes them out: smooth where the colour is, free to step where it steps.
"""

import torch
from jaxtyping import Float
from torch import Tensor

SMOOTHNESS, COLOR_STEP = 30.0, 8.0
"""Weight of neighbours, and the difference of 8-bit colours at which it falls to 1/e."""


def smooth_maps(
    depth: Float[Tensor, "h w"],
    displacement: Float[Tensor, "t h w 3"] | None,
    rgb: Float[Tensor, "h w 3"],
) -> tuple[Float[Tensor, "h w"], Float[Tensor, "t h w 3"] | None]:
    """Depth smoothed; a pixel that is farther then moves by as much more."""
    smooth = smooth_depth(depth, rgb)
    if displacement is None:
        return smooth, None
    return smooth, displacement * (smooth / depth)[..., None]


def smooth_depth(depth: Float[Tensor, "h w"], rgb: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w"]:
    """Depth above 0 in its own range; inverse depth is smoothed, which a plane has linear."""
    # OpenCV takes a tenth of a second to load, which small images need not wait for.
    import cv2

    guide = (rgb.clamp(0, 1) * 255).round().byte().cpu().numpy()
    # The nearest is 1, so that float32 holds any unit.
    inverse = (depth.min() / depth).float().cpu().numpy()
    smooth = cv2.ximgproc.fastGlobalSmootherFilter(guide, inverse, SMOOTHNESS, COLOR_STEP)
    # A weighted mean cannot leave the range; rounding could.
    smooth = torch.from_numpy(smooth.clip(inverse.min(), inverse.max())).to(depth)
    return (depth.min() / smooth).clamp(depth.min(), depth.max())
