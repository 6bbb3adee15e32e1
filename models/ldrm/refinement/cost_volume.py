"""Agreement of the other frames with each key frame at a series of depths (plane sweep).

Axes: ``b`` batch, ``f`` frames, ``k`` key frames, ``s`` other frames of a key, ``c`` channels,
``d`` depths, ``h w`` cells. Depths are evenly spaced in inverse depth, hence in parallax; the
agreement is the scalar product of features (MVSplat, arXiv 2403.14627, §3.1; plane sweep of
Collins 1996). Mean and maximum over the frames in which a point is visible: the maximum is right
also where the point is occluded or moves in some frames.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.ldrm.refinement.posed_video import camera_frames, flat_cameras
from diff4splat.models.ldrm.refinement.warping import inside, other_pixels, sampled

STEP = TIME_STRIDE // 2
"""Every second frame is compared: neighbours have little parallax."""
UNSEEN = -1.0
"""Agreement where a point is visible in no other frame."""


def cost_volume(
    features: Float[Tensor, "b f c h w"], cameras: Camera, inverse_depths: Float[Tensor, " d"]
) -> Float[Tensor, "b k d2 h w"]:
    """Mean, then maximum agreement per depth; ``cameras`` (b, f) are of the cells' size."""
    keys = range(0, features.shape[1], TIME_STRIDE)
    return torch.stack([_agreement(features, cameras, inverse_depths, key) for key in keys], 1)


def _agreement(
    features: Tensor, cameras: Camera, inverse_depths: Tensor, key: int
) -> Float[Tensor, "b d2 h w"]:
    others = torch.tensor([frame for frame in range(0, features.shape[1], STEP) if frame != key])
    height, width = features.shape[-2:]
    if len(others) == 0:
        shape = (len(features), 2 * len(inverse_depths), height, width)
        return features.new_full(shape, UNSEEN)
    agreement, visible = _compare(features, cameras, inverse_depths, (key, others))
    count = visible.sum(1)
    mean = (agreement * visible).sum(1) / count.clamp_min(1)
    best = agreement.masked_fill(~visible, UNSEEN).amax(1)
    return torch.cat([torch.where(count > 0, mean, UNSEEN), best], 1)


def _compare(
    features: Tensor,
    cameras: Camera,
    inverse_depths: Tensor,
    frames: tuple[int, Int[Tensor, " s"]],
) -> tuple[Float[Tensor, "b s d h w"], Tensor]:
    """Scalar products, and in which frames each point is visible."""
    key, others = frames
    reference = features[:, key]
    count, size = len(others), reference.shape[-2:]
    source = flat_cameras(camera_frames(cameras, torch.full_like(others, key)))
    depths = inverse_depths[None, :, None, None].expand(len(reference) * count, -1, *size)
    pixels, relative = other_pixels(source, flat_cameras(camera_frames(cameras, others)), depths)
    warped = sampled(features[:, others].flatten(0, 1), pixels).unflatten(0, (-1, count))
    product = (warped * reference[:, None, :, None]).mean(2)
    return product, inside(pixels, relative).unflatten(0, (-1, count))
