"""Flow matching: the velocity of the straight path between clean latents and noise.

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent grid. With ``level`` 0 clean and 1 noise,

    noisy = (1 − level) clean + level noise          target = noise − clean
    loss  = mean over c, t, h, w of (velocity − target)²

(Diff4Splat, arXiv 2511.00503, flow matching section; the sum of squares there is a mean here, so
that the weight does not depend on the picture size.) Where the first latent frame is the picture
that the video starts from, it has level 0 at every step and nothing to learn: it is left out.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.flow.path import velocity as path_velocity
from diff4splat.metrics.checks import promote, require_alike
from diff4splat.metrics.masked import masked_mean


def flow_matching(
    velocity: Float[Tensor, "b c t h w"],
    clean: Float[Tensor, "b c t h w"],
    noise: Float[Tensor, "b c t h w"],
    *,
    first_frame_is_clean: bool = False,
    weights: Float[Tensor, " b"] | None = None,
    channels: Float[Tensor, " c"] | None = None,
) -> Float[Tensor, " b"]:
    """Mean squared error of a predicted velocity, times ``weights``.

    ``channels`` says how much each latent channel counts; 1 on average keeps the scale.

    A video of nothing but the clean first frame gives 0.

    Raises:
        ShapeError: the shapes differ.
    """
    require_alike("velocity", velocity, clean)
    velocity, clean, noise = promote(velocity, clean, noise)
    error = (velocity - path_velocity(clean, noise)).square()
    if channels is not None:
        error = error * channels.to(error)[:, None, None, None]
    error = error[:, :, int(first_frame_is_clean) :].flatten(1)
    loss = masked_mean(error, torch.ones_like(error, dtype=torch.bool))
    if weights is None:
        return loss
    require_alike("weights", weights, loss)
    return loss * weights
