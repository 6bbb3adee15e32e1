"""The photograph's own pixels on geometry and motion that networks saw in a smaller copy (ours).

Axes: ``h w`` cells of the input view as networks see it, ``s`` pixels per cell side, ``p`` = s² h w
pixels of the photograph, ``n`` Gaussians before, ``q`` after. Every pixel takes after the cell
around it that is near and of its colour (``bilateral``): Gaussian, track and, blended with cells of
the same surface, depth.
"""

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.layered_image.occlusion_order import push_behind_surface
from diff4splat.generation.reconstruction import Canonical
from diff4splat.geometry.camera import project
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.geometry.rays import world_rays
from diff4splat.models.blocks.bilateral_upsampling import log_weights, neighbourhood
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.scene.harmonics import dc_from_color
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.static import StaticMotion

ONE_SURFACE = 0.1
"""Difference of log depth up to which neighbours are one surface."""


OPAQUE, WIDEST_PX = 0.95, 0.6
"""What the photograph shows is not seen through, and a pixel of it hides no other: cells may be
fainter and wider, where networks are unsure of an edge."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UpsampledScene:
    """A scene whose first Gaussians are pixels of a photograph."""

    gaussians: Gaussians
    motion: Motion
    cells: Int[Tensor, " q"]
    """Pixel of the photograph that each lies on; the number after the last for all others."""
    pixels: int
    """How many of the first are those pixels themselves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Pixels:
    """What the pixels of the photograph take over."""

    kept: Int[Tensor, " p"]
    """Which pixels: those with a cell near them that has a Gaussian."""
    parent: Int[Tensor, " p"]
    """Gaussian that each takes after."""
    log_depth: Float[Tensor, " p"]
    """Of z, against the parent's."""


def upsample_to_photo(
    canonical: Canonical, motion: Motion, small: InputImage, photo: InputImage
) -> UpsampledScene:
    """Gaussians of the first frame replaced by one per pixel of ``photo``.

    ``small`` is the photograph as networks saw it; its sides divide those of ``photo``.
    """
    first = int((canonical.cells < small.rgb[..., 0].numel()).sum())
    pixels = _take_over(canonical, first, small, photo)
    rest = _rest(canonical, first, small)
    fine = _fine_gaussians(canonical.gaussians, pixels, small, photo)
    behind = torch.arange(first, len(canonical.gaussians), device=pixels.parent.device)
    outside = behind.new_full((len(behind),), photo.rgb[..., 0].numel())
    grown = torch.cat([pixels.log_depth.exp(), torch.ones_like(behind, dtype=torch.float32)])
    return UpsampledScene(
        gaussians=concatenate([fine, rest]),
        motion=transfer_motion(motion, torch.cat([pixels.parent, behind]), grown),
        cells=torch.cat([pixels.kept, outside]),
        pixels=len(pixels.kept),
    )


def _rest(canonical: Canonical, first: int, small: InputImage) -> Gaussians:
    """Later frames and what backs them as they are, and the surroundings behind the picture."""
    own = len(canonical.told_cells)
    cells, size_px = canonical.cells[:first], small.camera.size_px
    depth = project(small.camera, canonical.gaussians.means[:first])[1]
    surface = depth.new_zeros(math.prod(size_px)).index_copy(0, cells, depth).view(size_px)
    neighbourhood = canonical.gaussians.select(slice(own, None))
    later = canonical.gaussians.select(slice(first, own))
    return concatenate([later, push_behind_surface(neighbourhood, surface, small.camera)])


def _take_over(canonical: Canonical, first: int, small: InputImage, photo: InputImage) -> _Pixels:
    """Parent and depth of every pixel."""
    height, width = small.camera.size_px
    side = photo.camera.size_px[0] // height
    cells = canonical.cells[:first]
    depth = project(small.camera, canonical.gaussians.means[:first])[1]
    log_depth = depth.new_zeros(height * width).index_copy(0, cells, depth.clamp_min(1e-6).log())
    row = cells.new_full((height * width,), -1).index_copy(0, cells, torch.arange(first).to(cells))
    depths = neighbourhood(log_depth.view(1, height, width), side)[0]
    rows = neighbourhood(row.view(1, height, width).float(), side)[0].long()
    weight = log_weights(small.rgb, photo.rgb).masked_fill(rows < 0, -torch.inf)
    best = weight.argmax(0, keepdim=True)
    own = depths.gather(0, best)
    share = weight.masked_fill((depths - own).abs() > ONE_SURFACE, -torch.inf).softmax(0)
    relative = (share * (depths - own)).sum(0).flatten()
    parent = rows.gather(0, best).flatten()
    kept = (parent >= 0).nonzero()[:, 0]
    return _Pixels(kept=kept, parent=parent[kept], log_depth=relative[kept])


def _fine_gaussians(
    coarse: Gaussians, pixels: _Pixels, small: InputImage, photo: InputImage
) -> Gaussians:
    """One per kept pixel: the parent, smaller, at the pixel's depth and of its colour."""
    parent = coarse.select(pixels.parent)
    side = photo.camera.size_px[0] // small.camera.size_px[0]
    depth = project(small.camera, parent.means)[1] * pixels.log_depth.exp()
    whole = depth.new_ones(photo.rgb[..., 0].numel()).index_copy(0, pixels.kept, depth)
    distance = distance_from_depth(photo.camera, whole.view(photo.camera.size_px)).flatten()
    widest = WIDEST_PX * depth / photo.camera.focal_px.prod().sqrt()
    scales = parent.scales * (pixels.log_depth.exp() / side)[:, None]
    origins, directions = (rays.flatten(0, 1)[pixels.kept] for rays in world_rays(photo.camera))
    return replace(
        parent,
        means=origins + distance[pixels.kept, None] * directions,
        scales=torch.minimum(scales, widest[:, None]),
        opacities=parent.opacities.clamp_min(OPAQUE),
        sh=dc_from_color(photo.rgb.flatten(0, 1)[pixels.kept])[:, None].to(parent.sh),
    )


def transfer_motion(
    motion: Motion, parent: Int[Tensor, " q"], grown: Float[Tensor, " q"]
) -> Motion:
    """Every Gaussian moves as its parent did; farther ones by as much more."""
    if not isinstance(motion, KeyframeMotion):
        return StaticMotion(time_range_s=motion.time_range_s)
    size = torch.cat([parent, motion.moving_index]).amax().item() + 1 if len(parent) else 0
    track = parent.new_full((size,), -1)
    track[motion.moving_index] = torch.arange(len(motion.moving_index), device=parent.device)
    own = track[parent]
    index = (own >= 0).nonzero()[:, 0]
    own = own[index]
    return replace(
        motion,
        moving_index=index,
        offsets=motion.offsets[:, own] * grown[index, None],
        rotations=motion.rotations[:, own],
        log_scale_offsets=motion.log_scale_offsets[:, own],
    )
