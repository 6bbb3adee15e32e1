"""Texture of patches in what a network inpaints (ours, ADR 53).

    inpainted image ─┬─ means within objects ─┬─ colours
                     └─ its own detail ───────┤
    image ─ detail of shifted patches ────────┘ where it belongs to this surface

Axes: ``h w`` pixels. MI-GAN repeats fine textures in steps of 16 pixels: a meadow gets rows. It
does know which surface goes on there. How much detail belongs there it often knows too; else the
image around says so, where it has as much of it everywhere.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.disoccluded.texture import (
    means_within_objects,
    patch_detail,
)
from diff4splat.generation.layered_image.inpainting import Inpaint
from diff4splat.generation.layered_image.windows import means_around

EVEN_SHARE, EVEN_SIGMA = 1 / 12, 0.06
"""Window over the longer side, and deviation of its mean colours at which several surfaces meet."""
DETAIL_SHARE, AGREEMENT_POWER = 1 / 24, 6
"""Window over the longer side in which strengths of detail are compared, and how strictly."""
AROUND_SHARE, AROUND_SIGMA = 1 / 4, 2.0
"""Reach of what counts as around, over the longer side; and deviation of the logarithm of strength
at which it is of several textures."""
LEAST_ENERGY = 1e-6
"""Detail that cannot be seen."""


def with_patch_texture(inpaint: Inpaint) -> Inpaint:
    """The same, with the detail of patches where one even surface has as much of it."""

    def inpaint_texture(
        rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]
    ) -> Float[Tensor, "h w 3"]:
        inpainted = inpaint(rgb, known)
        return inpainted if bool(known.all()) else textured_by_patches(inpainted, known)

    return inpaint_texture


def textured_by_patches(
    inpainted: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]
) -> Float[Tensor, "h w 3"]:
    """As ``inpainted`` where ``known``, somewhere but not everywhere; else its detail exchanged."""
    means = means_within_objects(inpainted)
    own = inpainted - means
    detail, likeness = patch_detail(inpainted, known, means)
    weight = likeness * _evenness(means) * _plausibility(own, detail, known[..., None])
    return torch.where(
        known[..., None], inpainted, (inpainted + weight * (detail - own)).clamp(0, 1)
    )


def _evenness(means: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w 1"]:
    """1 amid one surface, 0 where several meet."""
    deviation = means_around(means.square(), EVEN_SHARE) - means_around(means, EVEN_SHARE).square()
    variance = deviation.clamp_min(0).sum(-1, keepdim=True)
    return torch.exp(-variance / (2 * EVEN_SIGMA**2))


def _plausibility(
    own: Float[Tensor, "h w 3"], detail: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w 1"]
) -> Float[Tensor, "h w 1"]:
    """1 where ``detail`` is as strong as the network's own, or as the image's evenly is around."""
    of_network, of_patches = _strengths(~known, own, detail)
    typical, sameness = _around(*_strengths(known, own), known)
    return torch.maximum(
        _agreement(of_network, of_patches), sameness * _agreement(typical, of_patches)
    )


def _strengths(
    where: Bool[Tensor, "h w 1"], *details: Float[Tensor, "h w 3"]
) -> tuple[Float[Tensor, "h w 1"], ...]:
    """Mean square of the pixels ``where`` in the window around each, of every detail."""
    energy = torch.cat([each.square().sum(-1, keepdim=True) for each in details], -1)
    share = means_around(where.to(energy), DETAIL_SHARE).clamp_min(LEAST_ENERGY)
    means = means_around(torch.where(where, energy, 0.0), DETAIL_SHARE)
    return (means / share + LEAST_ENERGY).split(1, -1)


def _around(
    strength: Float[Tensor, "h w 1"], known: Bool[Tensor, "h w 1"]
) -> tuple[Float[Tensor, "h w 1"], Float[Tensor, "h w 1"]]:
    """Typical strength of the known pixels around each, and how far it is the same everywhere.

    A geometric mean, which a stroke hardly changes. The second is 0 where nothing is known.
    """
    weight = known.to(strength)
    logarithm = strength.log()
    share = means_around(weight, AROUND_SHARE)
    mean, square = (
        means_around(weight * each, AROUND_SHARE) / share.clamp_min(LEAST_ENERGY)
        for each in (logarithm, logarithm.square())
    )
    sameness = torch.exp(-(square - mean.square()).clamp_min(0) / (2 * AROUND_SIGMA**2))
    return mean.exp(), torch.where(share > LEAST_ENERGY, sameness, 0.0)


def _agreement(
    one: Float[Tensor, "h w 1"], other: Float[Tensor, "h w 1"]
) -> Float[Tensor, "h w 1"]:
    """1 where both are equally strong, 0 where one is far stronger."""
    return (2 * (one * other).sqrt() / (one + other)) ** AGREEMENT_POWER
