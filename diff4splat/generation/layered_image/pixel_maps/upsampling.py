"""Depth and displacement of the image's own pixels, from maps of the smaller copy (ours).

Axes: ``h w`` cells of the copy that the networks see, ``s`` pixels per cell side, ``t`` latent
frames. Each pixel takes the displacement of the cell near it that is most like it in colour. Its
depth is the mean of the near cells on that cell's surface, weighted in the same way (joint
bilateral upsampling, Kopf et al. 2007).
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.blocks.bilateral_upsampling import log_weights, neighbourhood

SAME_SURFACE = 0.1
"""Difference of log depth up to which neighbours are one surface."""


def upsample_maps(
    depth: Float[Tensor, "h w"],
    displacement: Float[Tensor, "t h w 3"] | None,
    rgb: tuple[Float[Tensor, "h w 3"], Float[Tensor, "sh sw 3"]],
) -> tuple[Float[Tensor, "sh sw"], Float[Tensor, "t sh sw 3"] | None]:
    """Both maps at the size of the second image of ``rgb``; the first is the smaller copy.

    A pixel that is farther than its cell moves by as much more, so that it moves as far in the
    image.
    """
    small, full = rgb
    if small.shape == full.shape:
        return depth, displacement
    side = full.shape[0] // small.shape[0]
    log_depth = neighbourhood(depth.clamp_min(1e-6).log()[None], side)[0]
    weight = log_weights(small, full)
    best = weight.argmax(0, keepdim=True)
    nearest = log_depth.gather(0, best)
    share = weight.masked_fill((log_depth - nearest).abs() > SAME_SURFACE, -torch.inf).softmax(0)
    relative = (share * (log_depth - nearest)).sum(0)
    fine_depth = nearest[0].exp() * relative.exp()
    if displacement is None:
        return fine_depth, None
    maps = displacement.movedim(-1, 1).flatten(0, 1)
    fine = neighbourhood(maps, side).gather(1, best.expand(len(maps), -1, -1, -1))[:, 0]
    fine = (fine * relative.exp()).unflatten(0, (-1, 3)).movedim(1, -1)
    return fine_depth, fine
