"""Displacement of an image by the motion prior: what moves, and how far each object does.

Axes: ``y x`` pixels of the copy that the motion prior sees.

    copy, text of every event ─ mask ─ rim ─ motion U-Net ─ displacement of every component
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.inputs.copies import Copies, motion_copy
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.mask_rim import nearest_inside, with_rim
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.rigid_components import rigid_component_offsets
from diff4splat.generation.motion.displacement_maps import (
    depth_at,
    with_displacement,
    with_majority_displacement,
)
from diff4splat.generation.motion.local_motion.find_objects import (
    LEAST_SIDE_PX,
    MovingMaps,
    with_moving_objects,
)
from diff4splat.generation.motion.motion_mask import event_of_pixels, motion_probability
from diff4splat.generation.motion.networks import motion_prior
from diff4splat.generation.motion.object_relief import (
    as_far_in_image,
    has_given_depth,
    with_bounded_relief,
    with_changed_depth,
)
from diff4splat.generation.motion.sampling import MotionRequest, MotionSample, sample_motion
from diff4splat.generation.object_shadow.prediction import predicted_darkening
from diff4splat.generation.object_shadow.shadow import ObjectShadow
from diff4splat.generation.settings import GenerationSettings, why_unguided
from diff4splat.models.hub.model import Model
from diff4splat.progress.run_log import RunLog

TOO_SMALL = f"what turns has less than {LEAST_SIDE_PX} px of the image"


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectMotion:
    """The motion prior of a model, and what it is asked for."""

    model: Model
    frames: int
    """Latent frames."""
    requests: tuple[MotionRequest, ...]
    """One for each event."""
    log: RunLog

    def added_to(self, maps: ImageMaps, images: Copies) -> ImageMaps:
        """``maps`` with the displacement of what moves; as they are where nothing does."""
        image = motion_copy(images, self.model.config.motion_unet.input_scale)
        event = self._events(image)
        if not event.any():
            self.log.record_skipped("motion U-Net", "nothing is to move", "its network calls")
            return maps
        depth = depth_at(maps, images.small, image)
        shows_photograph = image.reduction < images.small.reduction or image is images.small
        if shows_photograph:
            mask, depth = with_rim(event > 0, depth, image.rgb)
            event = torch.where(mask, event.flatten()[nearest_inside(event > 0)], event)
        displacement = self._displacement(image, event, depth)
        copy = MovingMaps(
            camera=image.camera,
            depth=depth,
            event=event,
            displacement=displacement,
            image_scale=len(images.image.rgb) / len(image.rgb),
        )
        moved, copy = self._moved(maps, copy)
        if not copy.displacement.any():
            return maps
        moved = replace(moved, shadows=self._shadows(images.image, event, displacement))
        if shows_photograph:
            return with_displacement(moved, image, copy.depth, copy.displacement)
        found = with_majority_displacement(moved, copy.depth, copy.displacement)
        return found if found.displacement is not None else replace(found, shadows=())

    def _moved(self, maps: ImageMaps, copy: MovingMaps) -> tuple[ImageMaps, MovingMaps]:
        """Both with bounded relief of what moves, and what it does about itself."""
        in_place = self._in_place(copy.event)
        moving = copy.displacement.any(-1).any(0) | in_place
        if not moving.any():
            return maps, copy
        maps, depth = with_bounded_relief(maps, copy.depth, moving, float(copy.camera.focal_px[0]))
        copy = replace(copy, depth=depth)
        predicted = not has_given_depth(maps)
        found, objects = with_moving_objects(copy, self.requests, round_bodies=predicted)
        if in_place.any() and objects is None:
            self.log.record_skipped("motion in place", TOO_SMALL, "the other side of objects")
        if found.depth is not depth:
            maps = with_changed_depth(maps, found.depth / depth, moving)
        if predicted:
            as_one = moving if objects is None else moving & (objects.number == 0)
            found = replace(
                found, displacement=as_far_in_image(found.displacement, found.depth, as_one)
            )
        return replace(maps, objects=objects), found

    def _shadows(
        self,
        image: InputImage,
        event: Int[Tensor, "y x"],
        displacement: Float[Tensor, "t y x 3"],
    ) -> tuple[ObjectShadow, ...]:
        """Of what each event displaces; those that darken something."""
        network = self.model.networks.object_shadow
        if network is None or not displacement.any():
            return ()
        travels = displacement.any(-1).any(0)
        masks = [travels & (event == number) for number in range(1, len(self.requests) + 1)]
        with self.log.phases.phase("find shadows"):
            found = [
                ObjectShadow(
                    darkening=predicted_darkening(network, image.rgb, mask),
                    displacement=displacement[:, mask].median(1).values,
                )
                for mask in masks
                if mask.any()
            ]
        return tuple(one for one in found if one.darkening.any())

    def _in_place(self, event: Int[Tensor, "y x"]) -> Bool[Tensor, "y x"]:
        """Pixels that move about themselves alone."""
        numbers = [number for number, one in enumerate(self.requests, 1) if one.in_place]
        return torch.isin(event, event.new_tensor(numbers))

    def _events(self, image: InputImage) -> Int[Tensor, "y x"]:
        """Number of the event that moves a pixel, from 1; 0 where none does."""
        prior, threshold = motion_prior(self.model.networks), self._settings.motion.threshold
        with self.log.phases.phase("find what moves", len(self.requests)) as advance:
            found = []
            for request in self.requests:
                found.append(motion_probability(prior, image, self.frames, request))
                advance()
            return event_of_pixels(found, threshold)

    def _displacement(
        self, image: InputImage, event: Int[Tensor, "y x"], depth: Float[Tensor, "y x"]
    ) -> Float[Tensor, "t y x 3"]:
        """Each component moves as the event that it belongs to says."""
        offsets = depth.new_zeros(self.frames, *depth.shape, 3)
        steps = self._settings.motion.steps * int(event.max())
        with self.log.phases.phase("sample motion", steps) as advance:
            for number, request in enumerate(self.requests, 1):
                moving = event == number
                if not moving.any() or request.in_place:
                    continue
                sample = self._sample(image, moving, request, advance)
                field, mean = sample.field, sample.mean_field
                offsets = offsets + rigid_component_offsets(field, moving, depth, mean)
        return offsets

    def _sample(
        self,
        image: InputImage,
        moving: Bool[Tensor, "y x"],
        request: MotionRequest,
        advance: Callable[[], None],
    ) -> MotionSample:
        """Of what an event moves, if the network is shown masks, else of the whole image."""
        mask = moving if self.model.config.motion_unet.object_mask else None
        prior, motion = motion_prior(self.model.networks), self._settings.motion
        sample = sample_motion(prior, image, self.frames, request, mask, advance)
        if sample.calls.saved:
            why = "no prompt" if request.text is None else why_unguided(motion.guidance)
            self.log.record_skipped("guidance pass", why, f"{sample.calls.saved} network calls")
        return sample

    @property
    def _settings(self) -> GenerationSettings:
        return self.requests[0].settings
