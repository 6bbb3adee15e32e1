"""Texture of patches in what a network inpaints (ours, ADR 53).

    inpainted image ─┬─ means within objects ─┬─ colours
                     └─ its own detail ───────┤
    image ─ detail of shifted patches ────────┘ where both are of one texture

Axes: ``h w`` pixels. MI-GAN repeats fine textures in steps of 16 pixels: a meadow gets rows. It
does know how much detail belongs where, and which surface goes on there.
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
    weight = likeness * _evenness(means) * _agreement(own, detail, ~known)
    return torch.where(
        known[..., None], inpainted, (inpainted + weight * (detail - own)).clamp(0, 1)
    )


def _evenness(means: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w 1"]:
    """1 amid one surface, 0 where several meet."""
    deviation = means_around(means.square(), EVEN_SHARE) - means_around(means, EVEN_SHARE).square()
    variance = deviation.clamp_min(0).sum(-1, keepdim=True)
    return torch.exp(-variance / (2 * EVEN_SIGMA**2))


def _agreement(
    one: Float[Tensor, "h w 3"], other: Float[Tensor, "h w 3"], hole: Bool[Tensor, "h w"]
) -> Float[Tensor, "h w 1"]:
    """1 where detail is equally strong in the hole, 0 where one has none."""
    share = means_around(hole[..., None].to(one), DETAIL_SHARE).clamp_min(LEAST_ENERGY)
    inside = [torch.where(hole[..., None], each, 0.0) for each in (one, other)]
    energies = [
        means_around(each.square().sum(-1, keepdim=True), DETAIL_SHARE) / share + LEAST_ENERGY
        for each in inside
    ]
    geometric = (energies[0] * energies[1]).sqrt()
    return (2 * geometric / (energies[0] + energies[1])) ** AGREEMENT_POWER
