"""A perceptual stand-in with nothing learnt: edges in eight directions, on four scales.

Axes: ``n`` images, ``c`` opponent colours, ``o`` directions, ``h w`` pixels. RGB in [0, 1].
Nobody's judgement was fitted. It shares with LPIPS that it compares pooled edges instead of
pixels, forgives a small shift, and punishes blur; its numbers are not LPIPS numbers.

On every scale, with r_o the derivative of a colour in direction o (Scharr's filters, steered), and
pooling by the binomial window 1 4 6 4 1,
every second pixel:

    e_o       = sqrt(pool(max(r_o, 0)²) + ε²) − ε             how strong, within a few pixels
    structure = Σ_{c o} (e − e')² / (Σ_{c o} (e² + e'²) + ε²)  contrast-normalised, 0 to 1
    distance  = mean of structure over scales and pixels + MSE of the coarsest scale's colours

Both images are divided by their *common* contrast: each by its own would hide a blur.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.metrics.checks import no_autocast, promote, require_alike

SCALES = 4
DIRECTIONS = 8
LEAST_CONTRAST = 0.02
"""ε, in RGB per pixel: edges weaker than this, such as the noise of 8 bits, hardly count."""
LEAST_PX = 3
"""Scales with a shorter side are left out; the first is always there."""
OPPONENT = (
    (1 / 3, 1 / 3, 1 / 3),
    (0.5, -0.5, 0.0),
    (0.25, 0.25, -0.5),
)
"""Light, red against green, yellow against blue (Ohta's colours)."""
BINOMIAL = (1 / 16, 4 / 16, 6 / 16, 4 / 16, 1 / 16)
SCHARR_SMOOTH = (3 / 16, 10 / 16, 3 / 16)
SCHARR_DERIVATIVE = (-0.5, 0.0, 0.5)


class GradientPyramidFeatures:
    """The stand-in; a ``PerceptualFeatures``."""

    @property
    def name(self) -> str:
        """Says what it is not."""
        return "stand-in: gradient pyramid, not LPIPS"

    def distance(
        self, image: Float[Tensor, "n 3 h w"], reference: Float[Tensor, "n 3 h w"]
    ) -> Float[Tensor, " n"]:
        """Distance of each pair; 0 with zero gradient for equal images, symmetric, any size.

        Raises:
            ShapeError: the shapes differ, or there is no pixel.
        """
        require_alike("image", image, reference)
        if 0 in image.shape[1:]:
            raise ShapeError(f"image: expected a pixel, got {tuple(image.shape)}")
        images = torch.cat(promote(image, reference))
        with no_autocast(images):
            scales = pyramid(opponent(images))
            structure = torch.stack([_structure(colors) for colors in scales]).mean(0)
        one, other = scales[-1].chunk(2)
        return structure + (one - other).square().mean((1, 2, 3))


def opponent(images: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n 3 h w"]:
    """Opponent colours."""
    return torch.einsum("oc,nchw->nohw", images.new_tensor(OPPONENT), images)


def pyramid(colors: Float[Tensor, "n c h w"]) -> list[Tensor]:
    """The colours on all scales, the finest first."""
    scales = [colors]
    while len(scales) < SCALES and min(scales[-1].shape[-2:]) >= 2 * LEAST_PX:
        scales.append(_halved(scales[-1]))
    return scales


def _structure(colors: Tensor) -> Tensor:
    """Contrast-normalised difference of the first and second half of ``n``, mean over pixels."""
    one, other = edges(colors).chunk(2)
    contrast = (one.square() + other.square()).sum(1) + LEAST_CONTRAST**2
    return ((one - other).square().sum(1) / contrast).mean((-2, -1))


def edges(colors: Tensor) -> Tensor:
    """Pooled strength of edges, ``n (c o) h w`` at every second pixel."""
    filters = _derivatives(colors).repeat(colors.shape[1], 1, 1, 1)
    padded = torch.nn.functional.pad(colors, (1, 1, 1, 1), mode="replicate")
    steered = torch.nn.functional.conv2d(padded, filters, groups=colors.shape[1])
    energy = _halved(steered.relu().square())
    return (energy + LEAST_CONTRAST**2).sqrt() - LEAST_CONTRAST


def _derivatives(like: Tensor) -> Tensor:
    """One 3×3 filter per direction, ``o 1 3 3``."""
    smooth, derivative = like.new_tensor(SCHARR_SMOOTH), like.new_tensor(SCHARR_DERIVATIVE)
    along, down = torch.outer(smooth, derivative), torch.outer(derivative, smooth)
    angles = [2 * math.pi * number / DIRECTIONS for number in range(DIRECTIONS)]
    return torch.stack([math.cos(angle) * along + math.sin(angle) * down for angle in angles])[
        :, None
    ]


def _halved(maps: Tensor) -> Tensor:
    """Every second pixel of both axes, after smoothing; the border goes on outside."""
    padded = torch.nn.functional.pad(maps, (2, 2, 2, 2), mode="replicate")
    window = maps.new_tensor(BINOMIAL).expand(maps.shape[1], 1, 1, -1)
    rows = torch.nn.functional.conv2d(padded, window, stride=(1, 2), groups=maps.shape[1])
    return torch.nn.functional.conv2d(rows, window.mT, stride=(2, 1), groups=maps.shape[1])
