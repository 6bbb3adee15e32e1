"""The objects of an image that move about themselves, and their displacement in its maps.

Axes: ``t`` latent frames, ``y x`` pixels of the copy that the motion prior sees.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.captions.vocabulary import ROLLING
from diff4splat.generation.layered_image.mask_rim import nearest_inside
from diff4splat.generation.layered_image.rigid_components import box_size_px, each_component
from diff4splat.generation.motion.local_motion.body import rounded
from diff4splat.generation.motion.local_motion.hidden_side import RIM_PX
from diff4splat.generation.motion.local_motion.motions import LOCAL_MOTIONS
from diff4splat.generation.motion.local_motion.moving_object import (
    MovingObject,
    MovingObjects,
    Timing,
    object_frame,
)
from diff4splat.generation.motion.sampling import MotionRequest
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.depth import unproject


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingMaps:
    """Maps of the copy that the motion prior sees."""

    camera: Camera
    depth: Float[Tensor, "y x"]
    event: Int[Tensor, "y x"]
    """Number of the event that moves a pixel, from 1; 0 where none does."""
    displacement: Float[Tensor, "t y x 3"]
    image_scale: float
    """Pixels of the image for each of the copy, along a side."""


LEAST_SIDE_PX = 24
"""Of the image: objects that are less wide or high do not turn, which a few cells cannot show."""

LEAST_DISPLACEMENT = 1e-6
"""Over depth: marks what is at rest at the times of latent frames, but moves between them."""


def with_moving_objects(
    maps: MovingMaps, requests: Sequence[MotionRequest], *, round_bodies: bool
) -> tuple[MovingMaps, MovingObjects | None]:
    """``maps`` with the motion about themselves of all objects, and these; None if there are none.

    Without ``round_bodies`` what turns keeps its depth, as it was given.
    """
    number, objects = torch.zeros_like(maps.event), []
    for event, request in enumerate(requests, 1):
        for inside in each_component(maps.event == event):
            if _moves_about_itself(maps, inside, request.local_motion):
                maps, one = _with_object(maps, inside, request, round_bodies=round_bodies)
                objects.append(one)
                number[inside] = len(objects)
    if not objects:
        return maps, None
    nearest = number.flatten()[nearest_inside(maps.displacement.any(-1).any(0))]
    return maps, MovingObjects(camera=maps.camera, number=nearest, objects=tuple(objects))


def _moves_about_itself(maps: MovingMaps, inside: Bool[Tensor, "y x"], motion: str) -> bool:
    """Whether the component does: it rolls only if it travels, and turns only if it is large."""
    if motion not in LOCAL_MOTIONS:
        return False
    if motion in ROLLING and not maps.displacement[:, inside].any():
        return False
    is_large = min(box_size_px(inside)) * maps.image_scale >= LEAST_SIDE_PX
    return is_large or not LOCAL_MOTIONS[motion].shows_back


def _with_object(
    maps: MovingMaps, inside: Bool[Tensor, "y x"], request: MotionRequest, *, round_bodies: bool
) -> tuple[MovingMaps, MovingObject]:
    """The maps in which the pixels ``inside`` are an object that moves as ``request`` says."""
    depth, middle = maps.depth, float(maps.depth[inside].median())
    if LOCAL_MOTIONS[request.local_motion].shows_back and round_bodies:
        rim_px = math.ceil(RIM_PX / maps.image_scale)
        depth, middle = rounded(depth, inside, float(maps.camera.focal_px[0]), rim_px)
    points = unproject(maps.camera, depth)
    one = MovingObject(
        frame=object_frame(points, inside, middle),
        motion=request.local_motion,
        displacement=maps.displacement[:, inside][:, 0],
        timing=Timing(
            duration_s=request.key_times_s[-1] - request.key_times_s[0],
            key_times=len(request.key_times_s),
            sense=-1.0 if request.seed % 2 else 1.0,
        ),
    )
    displacement = maps.displacement.clone()
    for frame, progress in enumerate(torch.linspace(0, 1, len(displacement)).tolist()):
        displacement[frame, inside] = one.positions(points[inside], progress) - points[inside]
    at_rest = inside & ~displacement.any(-1).any(0)
    displacement[-1, at_rest, 2] = LEAST_DISPLACEMENT * depth[at_rest]
    return replace(maps, depth=depth, displacement=displacement), one
