"""Gaussians of objects that move about themselves: where they are at every key time, and the back.

Axes: ``k`` key times, ``m`` moving Gaussians of one object, ``n`` all.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int, Shaped
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import GONE, GaussianSet, offset_motion
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer, LayeredImage
from diff4splat.generation.motion.local_motion.hidden_side import (
    RIM_PX,
    hidden_side,
    interior_colors,
)
from diff4splat.generation.motion.local_motion.mixed_rim import has_other_color
from diff4splat.generation.motion.local_motion.moving_object import MovingObject, MovingObjects
from diff4splat.generation.scene_assembly import joined
from diff4splat.geometry.camera import Camera, project
from diff4splat.geometry.depth import unproject
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion


def with_local_motion(
    gaussian_set: GaussianSet, layered: LayeredImage, objects: MovingObjects
) -> tuple[GaussianSet, int]:
    """``gaussian_set``, of the layers, with exact positions of what moves about itself.

    Objects that show their back get one, in place of layers that extend them. Also how many of the
    Gaussians the image shows; they come first.
    """
    visible_count = layered.visible_count
    if not isinstance(gaussian_set.motion, KeyframeMotion):
        return gaussian_set, visible_count
    kept = ~_does_not_follow(gaussian_set, visible_count, objects)
    result, visible_count = gaussian_set.select(kept), int(kept[:visible_count].sum())
    index = result.motion.moving_index
    number = object_number(result.gaussians.means[index], objects)
    chosen = [(number == each, one) for each, one in enumerate(objects.objects, 1)]
    result = replace(result, motion=_following(result.motion, result.gaussians, chosen))
    key_times_s = result.motion.key_times_s
    for each, one in enumerate(objects.objects, 1):
        if one.local.shows_back:
            visible = _visible_side(layered.layers[0], each, objects)
            result = replace(result, motion=_without_rim(result, visible))
            result = joined(result, _hidden_side(visible, one, key_times_s))
    return result, visible_count


def object_number(means: Float[Tensor, "n 3"], objects: MovingObjects) -> Int[Tensor, " n"]:
    """Of the object at the pixel where the input view shows each point."""
    return _at_pixels(objects.number, objects.camera, means)


def _at_pixels(
    values: Shaped[Tensor, "h w"], camera: Camera, means: Float[Tensor, "n 3"]
) -> Shaped[Tensor, " n"]:
    height, width = values.shape
    pixels, _ = project(camera, means)
    column, row = pixels.nan_to_num(0).floor().long().unbind(-1)
    return values[row.clamp(0, height - 1), column.clamp(0, width - 1)]


def _does_not_follow(
    gaussian_set: GaussianSet, visible_count: int, objects: MovingObjects
) -> Bool[Tensor, " n"]:
    """What moves with an object, but must not.

    Far from it: between two pixels lies the far side of an edge. Behind an object that turns:
    layers that extend it come to the front.
    """
    index = gaussian_set.motion.moving_index
    means = gaussian_set.gaussians.means[index]
    number = object_number(means, objects)
    drops = torch.zeros_like(index, dtype=torch.bool)
    for one_number, one in enumerate(objects.objects, 1):
        extends = (index >= visible_count) & one.local.shows_back
        drops |= (number == one_number) & (extends | ~one.frame.has(means))
    dropped = torch.zeros(len(gaussian_set.gaussians), dtype=torch.bool, device=index.device)
    dropped[index[drops]] = True
    return dropped


def _following(
    motion: KeyframeMotion,
    gaussians: Gaussians,
    chosen: Sequence[tuple[Bool[Tensor, " m"], MovingObject]],
) -> KeyframeMotion:
    """The motion in which the chosen moving Gaussians follow each object."""
    offsets, growth = motion.offsets.clone(), motion.log_scale_offsets.clone()
    shares = torch.linspace(0, 1, len(motion.key_times_s)).tolist()
    for rows, one in chosen:
        means = gaussians.means[motion.moving_index[rows]]
        for key, progress in enumerate(shares):
            offsets[key, rows] = one.positions(means, progress) - means
            growth[key, rows] = math.log(one.growth(progress))
    return replace(motion, offsets=offsets, log_scale_offsets=growth)


@dataclass(frozen=True, slots=True, kw_only=True)
class _VisibleSide:
    """What the image shows of one object."""

    pixels: ImageLayer
    inside: Bool[Tensor, "h w"]
    colors: Float[Tensor, "h w 3"]
    """Those of the image, but at the outline, where they may be mixed, of the interior."""
    rim: Bool[Tensor, "h w"]
    """Pixels whose colours are none of the object's."""


def _visible_side(pixels: ImageLayer, number: int, objects: MovingObjects) -> _VisibleSide:
    points = unproject(pixels.camera, pixels.depth)
    numbers = object_number(points.flatten(0, 1), objects).view_as(pixels.mask)
    inside = (numbers == number) & pixels.displacement.any(-1).any(0)
    # The mask is known to a pixel of the copy.
    cell_px = math.ceil(len(pixels.rgb) / len(objects.number))
    mixed_px = RIM_PX + 2 * cell_px
    colors = interior_colors(pixels, inside, mixed_px)
    rim = has_other_color(pixels.rgb, inside, colors, mixed_px)
    return _VisibleSide(pixels=pixels, inside=inside, colors=colors, rim=rim)


def _without_rim(gaussian_set: GaussianSet, visible: _VisibleSide) -> KeyframeMotion:
    """The motion in which pixels of other colours at the outline vanish once the object turns."""
    motion, pixels = gaussian_set.motion, visible.pixels
    means = gaussian_set.gaussians.means[motion.moving_index]
    growth = motion.log_scale_offsets.clone()
    growth[1:, _at_pixels(visible.rim, pixels.camera, means)] = GONE
    return replace(motion, log_scale_offsets=growth)


def _hidden_side(
    visible: _VisibleSide, one: MovingObject, key_times_s: Float[Tensor, " k"]
) -> GaussianSet:
    """What the image hides of an object, with its motion."""
    middle_z = float(one.frame.foot[2])
    gaussians = hidden_side(visible.pixels, visible.inside, middle_z, visible.colors)
    index = torch.arange(len(gaussians), device=visible.inside.device)
    at_rest = gaussians.means.new_zeros(2, len(index), 3)
    motion = offset_motion(index, at_rest, key_times_s)
    everything = torch.ones_like(index, dtype=torch.bool)
    return GaussianSet(
        gaussians=gaussians,
        motion=_following(motion, gaussians, [(everything, one)]),
        pixel_index=torch.full_like(index, NO_PIXEL),
    )
