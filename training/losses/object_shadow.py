"""Errors of the shadow that an object casts, where the image does not show the object itself.

Axes: ``b`` images, ``h w`` pixels. With the colours I of the image and J of the same without the
object, and the predicted darkening s

    darkening = mean w h(s − log((J + e) / (I + e))),   w = 1 + SHADOW_WEIGHT in the shadow
    lit_colors = mean (min(I exp(s), 1) − J)²

with h(d) = d² / 2B up to B, then |d| − B / 2 (Huber 1964): few pixels are far off, and must not
decide a step. Most pixels are in no shadow, and those that are count more.
"""

from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import smooth_l1_loss

from diff4splat.metrics.masked import masked_mean

LEAST_COLOR = 0.02
"""Added to colours: below it darkness is noise."""
DARKENING_RANGE = (-0.3, 1.8)
"""Of the truth; what lies beyond counts as these."""
SHADOW_WEIGHT, LEAST_DARKENING = 4.0, 0.05
BEND = 0.2
"""Difference of logarithms at which the error bends from a square to a line."""


def true_darkening(
    image: Float[Tensor, "b 3 h w"], without: Float[Tensor, "b 3 h w"]
) -> Float[Tensor, "b 3 h w"]:
    """Logarithm of the colour without the object over that with it."""
    ratio = (without + LEAST_COLOR).log() - (image + LEAST_COLOR).log()
    return ratio.clamp(*DARKENING_RANGE)


def darkening_error(
    predicted: Float[Tensor, "b 3 h w"],
    truth: Float[Tensor, "b 3 h w"],
    valid: Bool[Tensor, "b h w"],
) -> Float[Tensor, " b"]:
    """Huber's error, more of it in the shadow."""
    weight = 1 + SHADOW_WEIGHT * (truth > LEAST_DARKENING)
    error = (weight * smooth_l1_loss(predicted, truth, reduction="none", beta=BEND)).mean(1)
    return masked_mean(error.flatten(1), valid.flatten(1))


def lit_color_error(
    darkening: Float[Tensor, "b 3 h w"],
    image: Float[Tensor, "b 3 h w"],
    without: Float[Tensor, "b 3 h w"],
    valid: Bool[Tensor, "b h w"],
) -> Float[Tensor, " b"]:
    """Squared error of the image without the shadow; of no shadow for a darkening of 0."""
    error = ((image * darkening.exp()).clamp_max(1) - without).square().mean(1)
    return masked_mean(error.flatten(1), valid.flatten(1))
