"""Flow matching: the velocity of the straight path between clean latents and noise.

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent grid. With ``level`` 0 clean and 1 noise,

    noisy = (1 − level) clean + level noise          target = noise − clean
    loss  = mean over c, t, h, w of (velocity − target)²

(Diff4Splat, arXiv 2511.00503, flow matching section; the sum of squares there is a mean here, so
that the weight does not depend on the image size.) Where the first latent frame is the image
that the video starts from, it has level 0 at every step and nothing to learn: it is left out.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.flow.path import velocity as path_velocity
from diff4splat.metrics.checks import promote, require_alike


def flow_matching(
    velocity: Float[Tensor, "b c t h w"],
    clean: Float[Tensor, "b c t h w"],
    noise: Float[Tensor, "b c t h w"],
    *,
    first_frame_is_clean: bool = False,
    weights: Float[Tensor, " b"] | None = None,
    channels: Float[Tensor, " c"] | None = None,
    cells: Float[Tensor, "b t h w"] | None = None,
) -> Float[Tensor, " b"]:
    """Mean squared error of a predicted velocity, times ``weights``.

    ``channels`` weighs each latent channel; 1 on average keeps the scale. ``cells`` weighs each
    latent cell: the mean is over weighted cells, 0 where all weights are 0.

    A video of nothing but the clean first frame gives 0.

    Raises:
        ShapeError: the shapes differ.
    """
    require_alike("velocity", velocity, clean)
    velocity, clean, noise = promote(velocity, clean, noise)
    error = (velocity - path_velocity(clean, noise)).square()
    if channels is not None:
        error = error * channels.to(error)[:, None, None, None]
    first = int(first_frame_is_clean)
    share = torch.ones_like(error) if cells is None else cells.to(error)[:, None].expand_as(error)
    error, share = (part[:, :, first:].flatten(1) for part in (error, share))
    loss = (error * share).sum(1) / share.sum(1).clamp_min(torch.finfo(error.dtype).tiny)
    if weights is None:
        return loss
    require_alike("weights", weights, loss)
    return loss * weights
