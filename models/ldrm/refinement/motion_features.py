"""Features of the key frames with the motion of their pixels, for the deformation network.

Axes: ``b`` batch, ``k`` key frames, ``h w`` pixels, ``h4 w4`` cells of 4 pixels, ``s`` slots. With
:mod:`warped flow <diff4splat.models.ldrm.refinement.warped_flow>` among them the network need learn
neither to subtract the camera's motion nor to match images. No gradient passes.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.blocks.conv_block import CELL_PX
from diff4splat.models.blocks.precision import at_least_float32
from diff4splat.models.config.networks import TIME_STRIDE, ActivationConfig
from diff4splat.models.ldrm import activations
from diff4splat.models.ldrm.optical_flow.optical_flow import optical_flow
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.ldrm.refinement.warped_flow import (
    DISTANCES,
    SLOT_CUES,
    SLOTS,
    OpticalFlow,
    warped_flow,
)

MOTION_CHANNELS = SLOT_CUES * SLOTS + 1
"""Channels appended to the features: those of the slots, then the logarithm of depth."""
INPUT_SLOTS = tuple(
    sign + distance - 1 for sign in (0, len(DISTANCES)) for distance in (1, 2, 4, 8)
)
"""Distances of 1, 2, 4 and 8 to both sides: the deformation network sees these slots at once, and
all of them at the time that it is asked for."""
INPUT_CHANNELS = SLOT_CUES * len(INPUT_SLOTS) + 1


def motion_features(
    features: Float[Tensor, "b k c h4 w4"],
    raw_distance: Float[Tensor, "b k h w"],
    posed_video: PosedVideo,
    config: ActivationConfig,
    flow: OpticalFlow = optical_flow,
) -> Float[Tensor, "b d k h4 w4"]:
    """Features of the key frames, then their motion features."""
    with torch.no_grad(), torch.autocast(features.device.type, enabled=False):
        depth = key_depth(raw_distance, config)
        relative = (depth / PLANE_DEPTH).log()[:, :, None]
        slots = warped_flow(depth, posed_video, flow).flatten(2, 3)
        pixels = torch.cat([slots, relative], 2)
        cues = torch.nn.functional.avg_pool2d(pixels.flatten(0, 1), CELL_PX)
        cues = cues.unflatten(0, depth.shape[:2])
    return torch.cat([features, cues.to(features.dtype)], 2).transpose(1, 2)


def key_depth(
    raw_distance: Float[Tensor, "*b k h w"], config: ActivationConfig
) -> Float[Tensor, "*b k h w"]:
    """Depth z of the key frames' pixels: their base is a plane in front of their camera."""
    raw = at_least_float32(raw_distance)
    return PLANE_DEPTH * activations.bounded_factor(raw, config.log_distance_limit)


def slot_weights(elapsed: Float[Tensor, "*b"]) -> Float[Tensor, "*b s"]:
    """Weights of the two nearest slots at an offset in frames."""
    distance = elapsed.abs().clamp(DISTANCES[0], DISTANCES[-1])[..., None]
    near = (1 - (distance - torch.tensor(DISTANCES).to(distance)).abs()).clamp_min(0)
    later = (elapsed >= 0)[..., None]
    return torch.cat([near * later, near * ~later], -1)


def input_motion(motion: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c2 h w"]:
    """Of all motion channels those that the deformation network sees at once."""
    slots = motion[:, :-1].unflatten(1, (SLOTS, SLOT_CUES))[:, list(INPUT_SLOTS)]
    return torch.cat([slots.flatten(1, 2), motion[:, -1:]], 1)


def keyframe_span(keys: int) -> int:
    """Frames from the first key frame to the last."""
    return TIME_STRIDE * (keys - 1)
