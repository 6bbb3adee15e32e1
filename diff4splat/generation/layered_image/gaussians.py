"""From layers to Gaussians and their motion: once, at the end.

Axes: ``h w`` cells of a layer, ``t`` latent frames, ``k`` key times, ``n`` Gaussians, ``m`` moving
ones. Gaussians keep the order of the layers, and within a layer that of its rows.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.steep_surface import in_steep_surface
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer, LayeredImage
from diff4splat.geometry import quaternion
from diff4splat.geometry.depth import unproject
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.scene.harmonics import dc_from_color
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.static import StaticMotion

GONE = math.log(0.02)
"""Growth of what vanishes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussianSet:
    """Gaussians with their motion, and which pixel of the image each one shows."""

    gaussians: Gaussians
    motion: Motion
    pixel_index: Int[Tensor, " n"]
    """``NO_PIXEL`` for those whose colour no pixel decides."""

    def select(self, chosen: Bool[Tensor, " n"]) -> "GaussianSet":
        """The chosen ones, in order."""
        return GaussianSet(
            gaussians=self.gaussians.select(chosen),
            motion=self.motion.select(chosen),
            pixel_index=self.pixel_index[chosen],
        )


def layer_gaussians(layer: ImageLayer) -> Gaussians:
    """One round Gaussian per valid cell."""
    camera, depth = layer.camera, layer.depth[layer.mask]
    radius = layer.footprint_px * depth / camera.focal_px.prod().sqrt()
    facing = quaternion.from_matrix(camera.world_from_camera[:3, :3])
    return Gaussians(
        means=unproject(camera, layer.depth)[layer.mask],
        quats=facing.repeat(len(depth), 1),
        scales=radius[:, None].repeat(1, 3),
        opacities=torch.full_like(depth, layer.opacity),
        sh=dc_from_color(layer.rgb[layer.mask])[:, None],
    )


def image_gaussians(image: LayeredImage, key_times_s: Float[Tensor, " k"]) -> GaussianSet:
    """All layers as Gaussians; displacements are linear between the times of latent frames."""
    return GaussianSet(
        gaussians=concatenate([_layer_gaussians(layer) for layer in image.layers]),
        motion=layers_motion(image, key_times_s),
        pixel_index=torch.cat([_pixel_index(layer) for layer in image.layers]),
    )


def _layer_gaussians(layer: ImageLayer) -> Gaussians:
    found = layer_gaussians(layer)
    return in_steep_surface(found, layer) if layer.in_surface else found


def layers_motion(image: LayeredImage, key_times_s: Float[Tensor, " k"]) -> Motion:
    """Key-framed motion of the displaced cells; static where there are none."""
    index, offsets, first = [], [], 0
    for layer in image.layers:
        if layer.displacement is not None:
            rows = layer.displacement[:, layer.mask]
            moving = rows.any(-1).any(0).nonzero()[:, 0]
            index.append(first + moving)
            offsets.append(rows[:, moving])
        first += int(layer.mask.sum())
    if not sum(map(len, index)):
        return StaticMotion(time_range_s=(float(key_times_s[0]), float(key_times_s[-1])))
    return offset_motion(torch.cat(index), torch.cat(offsets, 1), key_times_s)


def offset_motion(
    index: Int[Tensor, " m"], offsets: Float[Tensor, "t m 3"], key_times_s: Float[Tensor, " k"]
) -> KeyframeMotion:
    """Translation alone, at key times spread evenly over the latent frames."""
    at_keys = torch.stack(
        [between(offsets, fraction) for fraction in torch.linspace(0, 1, len(key_times_s)).tolist()]
    )
    identity = offsets.new_tensor([1.0, 0.0, 0.0, 0.0])
    return KeyframeMotion(
        key_times_s=key_times_s,
        moving_index=index,
        offsets=at_keys,
        rotations=identity.expand(*at_keys.shape[:2], 4).clone(),
        log_scale_offsets=torch.zeros_like(at_keys),
    )


def between(offsets: Float[Tensor, "t *m 3"], fraction: float) -> Float[Tensor, "*m 3"]:
    """Offsets at a fraction of the clip, linear between latent frames."""
    place = fraction * (len(offsets) - 1)
    before = min(int(place), len(offsets) - 2)
    return torch.lerp(offsets[before], offsets[before + 1], place - before)


def _pixel_index(layer: ImageLayer) -> Int[Tensor, " n"]:
    if layer.pixel_index is None:
        return torch.full((int(layer.mask.sum()),), NO_PIXEL, device=layer.mask.device)
    return layer.pixel_index[layer.mask]
