"""Gaussians of objects that move about themselves: where they are at every key time, and the back.

Axes: ``k`` key times, ``m`` moving Gaussians of one object, ``n`` all.
"""

import math
from dataclasses import replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import GaussianSet
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer, LayeredImage
from diff4splat.generation.motion.local_motion.hidden_side import RIM_PX, hidden_side
from diff4splat.generation.motion.local_motion.moving_object import MovingObject, MovingObjects
from diff4splat.generation.scene_assembly import joined
from diff4splat.geometry.camera import project
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
    gaussian_set, visible_count = gaussian_set.select(kept), int(kept[:visible_count].sum())
    motion = gaussian_set.motion
    number = object_number(gaussian_set.gaussians.means, objects)[motion.moving_index]
    for index, one in enumerate(objects.objects, 1):
        motion = _with_object(motion, number == index, gaussian_set.gaussians, one)
    result = replace(gaussian_set, motion=motion)
    for index, one in enumerate(objects.objects, 1):
        if one.local.shows_back:
            result = joined(result, _hidden_side(layered.layers[0], index, objects, motion))
    return result, visible_count


def object_number(means: Float[Tensor, "n 3"], objects: MovingObjects) -> Int[Tensor, " n"]:
    """Of the object at the pixel where the input view shows each point."""
    height, width = objects.number.shape
    pixels, _ = project(objects.camera, means)
    column, row = pixels.nan_to_num(0).floor().long().unbind(-1)
    return objects.number[row.clamp(0, height - 1), column.clamp(0, width - 1)]


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


def _with_object(
    motion: KeyframeMotion, chosen: Bool[Tensor, " m"], gaussians: Gaussians, one: MovingObject
) -> KeyframeMotion:
    """The motion in which the ``chosen`` moving Gaussians follow the object."""
    means = gaussians.means[motion.moving_index[chosen]]
    offsets, growth = motion.offsets.clone(), motion.log_scale_offsets.clone()
    shares = torch.linspace(0, 1, len(motion.key_times_s)).tolist()
    for key, progress in enumerate(shares):
        offsets[key, chosen] = one.positions(means, progress) - means
        growth[key, chosen] = math.log(one.growth(progress))
    return replace(motion, offsets=offsets, log_scale_offsets=growth)


def _hidden_side(
    pixels: ImageLayer, index: int, objects: MovingObjects, motion: KeyframeMotion
) -> GaussianSet:
    """What the image hides of an object, with its motion."""
    points = unproject(pixels.camera, pixels.depth)
    number = object_number(points.flatten(0, 1), objects).view_as(pixels.mask)
    inside = (number == index) & pixels.displacement.any(-1).any(0)
    one = objects.objects[index - 1]
    # The mask is known to a pixel of the copy.
    cell_px = math.ceil(len(pixels.rgb) / len(objects.number))
    gaussians = hidden_side(pixels, inside, float(one.frame.foot[2]), RIM_PX + 2 * cell_px)
    count, keys = len(gaussians), len(motion.key_times_s)
    everything = torch.arange(count, device=inside.device)
    zero = gaussians.means.new_zeros(keys, count, 3)
    still = KeyframeMotion(
        key_times_s=motion.key_times_s,
        moving_index=everything,
        offsets=zero,
        rotations=gaussians.quats.expand(keys, -1, -1).clone(),
        log_scale_offsets=zero,
    )
    return GaussianSet(
        gaussians=gaussians,
        motion=_with_object(still, torch.ones_like(everything, dtype=torch.bool), gaussians, one),
        pixel_index=torch.full_like(everything, NO_PIXEL),
    )
