"""Shadows as Gaussians: as transparent as the shadow is bright, sliding over the ground.

Axes: ``m`` pixels in the shadow, ``k`` key times, ``t`` latent frames, ``h w`` pixels.

The image's own pixels have the colours of lit ground. So what lies where a shadow was is lit once
it has moved on, and what it moves to is darkened as much. A shadow is black but for the light that
other colours than its darkest have in it.
"""

import math
from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import GONE, GaussianSet, between
from diff4splat.generation.layered_image.types import NO_PIXEL, LayeredImage, moving_mask
from diff4splat.generation.object_shadow.ground import along_plane, ground_normal, on_ground
from diff4splat.generation.object_shadow.shadow import ObjectShadow
from diff4splat.generation.scene_assembly import joined
from diff4splat.geometry.depth import unproject
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import dc_from_color
from diff4splat.scene.motion.keyframes import KeyframeMotion

FOOTPRINT_PX = 0.6
"""Standard deviation of a pixel's Gaussian: neighbours overlap without a pattern."""
OVERLAP = 2 * math.pi * FOOTPRINT_PX**2
"""Sum of the Gaussians of all pixels at one of them."""


def with_shadows(
    gaussian_set: GaussianSet,
    layered: LayeredImage,
    shadows: Sequence[ObjectShadow],
    key_times_s: Float[Tensor, " k"],
) -> GaussianSet:
    """``gaussian_set``, then the shadows of what moves."""
    pixels = layered.layers[0]
    static = ~moving_mask(pixels.depth, pixels.displacement)
    for shadow in shadows:
        chosen = static & (shadow.darkening > 0).any(-1)
        if bool(chosen.any()):
            one = shadow_gaussians(layered, shadow, chosen, key_times_s)
            gaussian_set = joined(gaussian_set, one)
    return gaussian_set


def shadow_gaussians(
    layered: LayeredImage,
    shadow: ObjectShadow,
    chosen: Bool[Tensor, "h w"],
    key_times_s: Float[Tensor, " k"],
) -> GaussianSet:
    """One round Gaussian per chosen pixel, of which there must be some."""
    pixels, darkening = layered.layers[0], shadow.darkening[chosen]
    points = unproject(pixels.camera, pixels.depth)[chosen]
    displacement = along_plane(shadow.displacement, ground_normal(points, darkening.amax(-1)))
    shares = torch.linspace(0, 1, len(key_times_s)).tolist()
    placed, gone = zip(
        *(
            on_ground(points + between(displacement, share), pixels.camera, layered.ground_depth)
            for share in shares
        ),
        strict=True,
    )
    positions, index = torch.stack(placed), torch.arange(len(points), device=points.device)
    growth = torch.where(torch.stack(gone), GONE, (positions[..., 2] / positions[0, :, 2]).log())
    identity = points.new_tensor([1.0, 0.0, 0.0, 0.0])
    motion = KeyframeMotion(
        key_times_s=key_times_s,
        moving_index=index,
        offsets=positions - positions[0],
        rotations=identity.repeat(*positions.shape[:2], 1),
        log_scale_offsets=growth[..., None].expand_as(positions).clone(),
    )
    through, rgb = veil(pixels.rgb[chosen], darkening)
    focal_px = pixels.camera.focal_px.prod().sqrt()
    gaussians = Gaussians(
        means=positions[0],
        quats=identity.repeat(len(points), 1),
        scales=(FOOTPRINT_PX / focal_px * positions[0, :, 2:]).expand_as(points).clone(),
        opacities=1 - through ** (1 / OVERLAP),
        sh=dc_from_color(rgb)[:, None],
    )
    return GaussianSet(
        gaussians=gaussians, motion=motion, pixel_index=torch.full_like(index, NO_PIXEL)
    )


def veil(
    rgb: Float[Tensor, "m 3"], darkening: Float[Tensor, "m 3"]
) -> tuple[Float[Tensor, " m"], Float[Tensor, "m 3"]]:
    """Share of light that a layer lets through, and its colour, which darken ``rgb`` like that.

    The least light that keeps every colour of the layer at 0 or above.
    """
    through = (-darkening).exp().amin(-1)
    added = rgb * ((-darkening).exp() - through[:, None])
    return through, (added / (1 - through[:, None]).clamp_min(1e-6)).clamp(0, 1)
