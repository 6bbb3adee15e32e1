"""What the video autoencoder is trained by, beside ``perceptual_error``.

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent grid, ``*d`` everything else of a video.

    kl          = mean of ½ (μ² + σ² − 1 − ln σ²)           KL(N(μ, σ²) ‖ N(0, 1)) per dimension
    charbonnier = mean of sqrt(d² + ε²) − ε,  ε = 1e-3      (Lai et al., arXiv 1704.03915, §3.3)

Latent diffusion sums the divergence over dimensions (arXiv 2112.10752, appendix G); the mean makes
its weight independent of the latent's size. Charbonnier is the absolute error with a gradient at 0.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.metrics.checks import promote, require_alike

CHARBONNIER_WIDTH = 1e-3
"""Below this error the loss is quadratic."""


def kl_divergence(
    mean: Float[Tensor, "b c t h w"], log_variance: Float[Tensor, "b c t h w"]
) -> Float[Tensor, " b"]:
    """How far a diagonal Gaussian posterior is from the standard normal, mean over dimensions.

    Raises:
        ShapeError: the shapes differ.
    """
    require_alike("log_variance", log_variance, mean)
    mean, log_variance = promote(mean, log_variance)
    # expm1 keeps the small difference of near-equal numbers around a variance of 1.
    divergence = 0.5 * (mean.square() + (log_variance.expm1() - log_variance))
    return divergence.flatten(1).mean(1)


def charbonnier(
    video: Float[Tensor, "b *d"], reference: Float[Tensor, "b *d"]
) -> Float[Tensor, " b"]:
    """Smooth absolute error of a reconstruction; 0 if equal.

    Raises:
        ShapeError: the shapes differ.
    """
    require_alike("video", video, reference)
    video, reference = promote(video, reference)
    width = torch.full_like(video[:1], CHARBONNIER_WIDTH)
    error = torch.hypot(video - reference, width) - CHARBONNIER_WIDTH
    return error.flatten(1).mean(1)
