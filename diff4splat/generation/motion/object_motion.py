"""Displacement of an image by the motion prior: what moves, and how far each object does.

Axes: ``y x`` pixels of the copy that the motion prior sees, ``n`` objects.

    copy, text ─ mask ─ rim ─ components ─ motion U-Net ─ displacement of every component
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.inputs.copies import Copies, motion_copy
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.mask_rim import with_rim
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.rigid_components import (
    connected_components,
    rigid_component_offsets,
)
from diff4splat.generation.motion.displacement_maps import (
    depth_at,
    with_displacement,
    with_majority_displacement,
)
from diff4splat.generation.motion.motion_mask import motion_probability
from diff4splat.generation.motion.networks import motion_prior
from diff4splat.generation.motion.sampling import MotionRequest, MotionSample, sample_motion
from diff4splat.generation.settings import why_unguided
from diff4splat.models.hub.model import Model
from diff4splat.progress.run_log import RunLog


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectMotion:
    """The motion prior of a model, and what it is asked for."""

    model: Model
    frames: int
    """Latent frames."""
    request: MotionRequest
    log: RunLog

    def added_to(self, maps: ImageMaps, images: Copies) -> ImageMaps:
        """``maps`` with the displacement of what moves; as they are where nothing does."""
        image = motion_copy(images, self.model.config.motion_unet.input_scale)
        mask = self._mask(image)
        if not mask.any():
            self.log.record_skipped("motion U-Net", "nothing is to move", "its network calls")
            return maps
        depth = depth_at(maps, images.small, image)
        shows_photograph = image.reduction < images.small.reduction or image is images.small
        if shows_photograph:
            mask, depth = with_rim(mask, depth, image.rgb)
        displacement = self._displacement(image, mask, depth)
        if not displacement.any():
            return maps
        if shows_photograph:
            return with_displacement(maps, image, depth, displacement)
        return with_majority_displacement(maps, depth, displacement)

    def _mask(self, image: InputImage) -> Bool[Tensor, "y x"]:
        prior, request = motion_prior(self.model.networks), self.request
        with self.log.phases.phase("find what moves"):
            found = motion_probability(prior, image, self.frames, request)
            return found.mask(request.settings.motion.threshold)

    def _displacement(
        self, image: InputImage, mask: Bool[Tensor, "y x"], depth: Float[Tensor, "y x"]
    ) -> Float[Tensor, "t y x 3"]:
        component = connected_components(mask)
        motion = self._sample(image, component)
        return rigid_component_offsets(motion.field, component, depth, motion.mean_field)

    def _sample(self, image: InputImage, component: Int[Tensor, "y x"]) -> MotionSample:
        """Of every component, if the network is shown masks, else of all together."""
        prior, motion, masks = motion_prior(self.model.networks), self.request.settings.motion, None
        if self.model.config.motion_unet.object_mask:
            numbers = range(1, int(component.max()) + 1)
            masks = torch.stack([component == number for number in numbers])
        with self.log.phases.phase("sample motion", motion.steps) as advance:
            sample = sample_motion(prior, image, self.frames, self.request, masks, advance)
        if sample.calls.saved:
            why = "no prompt" if self.request.text is None else why_unguided(motion.guidance)
            self.log.record_skipped("guidance pass", why, f"{sample.calls.saved} network calls")
        return sample
