"""Depth and displacement of an image by the priors of a model.

Axes: ``h w`` pixels of the copy that the networks see. Without a depth prior the image lies on a
plane; without a motion prior it is static.
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.depth.prediction import SCALES, PredictedDepth, predict_depth
from diff4splat.generation.given_depth.maps import given_depth, reduced_depth
from diff4splat.generation.inputs.copies import Copies, larger_copy
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.pixel_maps.image_maps import FineMaps, ImageMaps
from diff4splat.generation.layered_image.pixel_maps.supported_parts import with_support
from diff4splat.generation.layered_image.pixel_maps.upright_strips import straightened
from diff4splat.generation.motion.object_motion import ObjectMotion
from diff4splat.generation.motion.sampling import MotionRequest
from diff4splat.models.hub.model import Model
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.progress.run_log import RunLog

ENLARGEMENT = 1.5
"""Sides of a small copy for an image backbone (chosen in docs/log/depth-prior.md)."""


def image_maps(
    model: Model, images: Copies, frames: int, requests: Sequence[MotionRequest], log: RunLog
) -> ImageMaps:
    """Depth, and displacement over ``frames`` latent frames, by the priors that are loaded.

    ``requests`` has one for each event of the prompt.
    """
    with log.phases.phase("predict depth"):
        depth, fine = _depths(model, images, log)
    maps = ImageMaps(depth=depth, displacement=None, fine=fine)
    if model.networks.motion_unet is None or frames < 2 or not requests:
        return maps
    motion = ObjectMotion(model=model, frames=frames, requests=tuple(requests), log=log)
    return motion.added_to(maps, images)


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
    depth = found.depth
    if larger.reduction > 1:  # Small images are no photographs: the prior knows their towers.
        depth = straightened(depth, float(larger.camera.focal_px[1]))
        if bool(found.out_of_domain):
            depth = with_support(depth, larger.rgb)
    fine = FineMaps(rgb=larger.rgb, depth=depth)
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
