"""Depth and displacement of an image by the priors of a model.

Axes: ``h w`` pixels of the copy that the networks see, ``t`` latent frames, ``s d`` text. Without a
depth prior the image lies on a plane; without a motion prior it is static.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.depth_prediction import SCALES, PredictedDepth, predict_depth
from diff4splat.generation.given_depth.maps import given_depth, reduced_depth
from diff4splat.generation.given_depth.source import DepthSource
from diff4splat.generation.inputs.input_image import InputImage, downsample, enlarged
from diff4splat.generation.layered_image.mask_rim import with_rim
from diff4splat.generation.layered_image.pixel_maps.image_maps import FineMaps, ImageMaps
from diff4splat.generation.layered_image.rigid_components import rigid_component_offsets
from diff4splat.generation.motion.displacement_maps import (
    depth_at,
    with_displacement,
    with_majority_displacement,
)
from diff4splat.generation.motion.networks import motion_prior
from diff4splat.generation.motion.sampling import MotionRequest, MotionSample, sample_motion
from diff4splat.generation.settings import why_unguided
from diff4splat.models.hub.model import Model
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.progress.run_log import RunLog

ENLARGEMENT = 1.5
"""Sides of a small copy for an image backbone (chosen in docs/log/depth-prior.md)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Copies:
    """An image, and the smaller copy of it that networks see."""

    image: InputImage
    small: InputImage
    depth: DepthSource | None = None
    """Depth of the image that takes the place of the model's own prior."""


def image_maps(
    model: Model, images: Copies, frames: int, request: MotionRequest, log: RunLog
) -> ImageMaps:
    """Depth, and displacement over ``frames`` latent frames, by the priors that are loaded."""
    with log.phases.phase("predict depth"):
        depth, fine = _depths(model, images, log)
    maps = ImageMaps(depth=depth, displacement=None, fine=fine)
    if model.networks.motion_unet is None or frames < 2:
        return maps
    image = motion_copy(images, model.config.motion_unet.input_scale)
    motion = _sample_motion(model, image, frames, request, log)
    mask = motion.mask(request.settings.motion.threshold)
    mean = motion.field if request.settings.motion.steps == 1 else motion.mean_field
    depth = depth_at(maps, images.small, image)
    shows_photograph = image.reduction < images.small.reduction or image is images.small
    if shows_photograph:
        mask, depth = with_rim(mask, depth, image.rgb)
    displacement = rigid_component_offsets(motion.field, mask, depth, mean)
    if not displacement.any():
        return maps
    if shows_photograph:
        return with_displacement(maps, image, depth, displacement)
    return with_majority_displacement(maps, depth, displacement)


def larger_copy(images: Copies, scale: int) -> InputImage:
    """The copy with ``scale`` times the small side, where the photograph is reduced so far."""
    reduction = images.small.reduction
    if scale == 1 or reduction % scale:
        return images.small
    return downsample(images.image, reduction // scale)


def motion_copy(images: Copies, scale: int) -> InputImage:
    """The copy with ``scale`` times the small side: of the photograph's pixels, or enlarged."""
    larger = larger_copy(images, scale)
    return larger if scale == 1 or larger is not images.small else enlarged(larger, scale)


def _depths(
    model: Model, images: Copies, log: RunLog
) -> tuple[Float[Tensor, "h w"], FineMaps | None]:
    """Depth of the copy; where the prior sees a larger one, its own and that one reduced."""
    if images.depth is not None:
        return _given_depths(images, log)
    if model.networks.monocular_depth is None:
        log.depth["source"] = "plane"
        return image_depth(model, images.small), None
    larger = larger_copy(images, model.config.monocular_depth.photo_scale)
    found = predicted_depth(model, larger, is_larger=larger is not images.small)
    log.depth.update(found.record())
    if larger is images.small:
        return found.depth, None
    fine = FineMaps(rgb=larger.rgb, depth=found.depth)
    return reduced_depth(fine.depth, images.small.camera.size_px), fine


def _given_depths(images: Copies, log: RunLog) -> tuple[Float[Tensor, "h w"], FineMaps | None]:
    """Given depth at the size of the image, and reduced."""
    depth = given_depth(images.depth, images.image, log)
    if images.small.camera.size_px == images.image.camera.size_px:
        return depth, None
    fine = FineMaps(rgb=images.image.rgb, depth=depth, smooth=False)
    return reduced_depth(depth, images.small.camera.size_px), fine


def image_depth(model: Model, image: InputImage) -> Float[Tensor, "h w"]:
    """Z of every pixel in scene units, by the depth prior or on a plane."""
    if model.networks.monocular_depth is None:
        return torch.full_like(image.rgb[..., 0], PLANE_DEPTH)
    return predicted_depth(model, image).depth


def predicted_depth(model: Model, image: InputImage, *, is_larger: bool = False) -> PredictedDepth:
    """By the depth prior; ``is_larger`` of the copy that photographs have for it.

    An image backbone sees a small copy enlarged: it was trained on larger images.
    """
    network, config = model.networks.monocular_depth, model.config.monocular_depth
    factor = ENLARGEMENT if config.image_backbone and not is_larger else 1
    scales = [factor * scale for scale in (SCALES if image.reduction > 1 else SCALES[:1])]
    return predict_depth(network, image.rgb, model.config.activation, scales)


def _sample_motion(
    model: Model, image: InputImage, frames: int, request: MotionRequest, log: RunLog
) -> MotionSample:
    motion = request.settings.motion
    with log.phases.phase("sample motion", motion.steps) as advance:
        sample = sample_motion(motion_prior(model.networks), image, frames, request, advance)
    if sample.calls.saved:
        why = "no prompt" if request.text is None else why_unguided(motion.guidance)
        log.record_skipped("guidance pass", why, f"{sample.calls.saved} network calls")
    return sample
