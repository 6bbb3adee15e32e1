"""How well the other frames agree with each key frame at each of a series of depths.

Axes: ``b`` batch, ``f`` frames, ``k`` key frames, ``s`` other frames of a key, ``c`` channels,
``d`` depths, ``h w`` cells. Depths are evenly spaced in inverse depth, hence in parallax; the
agreement is the scalar product of features (MVSplat, arXiv 2403.14627, §3.1; plane sweep of
Collins 1996). Mean and maximum over the frames that see a point: the maximum still knows the depth
where some frames are blocked by something nearer or shows what moves.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.ldrm.refinement.posed_video import camera_frames, flat_cameras
from diff4splat.models.ldrm.refinement.warping import inside, other_pixels, sampled

STEP = TIME_STRIDE // 2
"""Every second frame is compared: neighbours have hardly any parallax."""
UNSEEN = -1.0
"""Agreement where no other frame sees a point."""


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
    agreed, seen = _compared(features, cameras, inverse_depths, (key, others))
    count = seen.sum(1)
    mean = (agreed * seen).sum(1) / count.clamp_min(1)
    best = agreed.masked_fill(~seen, UNSEEN).amax(1)
    return torch.cat([torch.where(count > 0, mean, UNSEEN), best], 1)


def _compared(
    features: Tensor,
    cameras: Camera,
    inverse_depths: Tensor,
    frames: tuple[int, Int[Tensor, " s"]],
) -> tuple[Float[Tensor, "b s d h w"], Tensor]:
    """Scalar products, and which of them mean something."""
    key, others = frames
    own = features[:, key]
    count, size = len(others), own.shape[-2:]
    seeing = flat_cameras(camera_frames(cameras, torch.full_like(others, key)))
    depths = inverse_depths[None, :, None, None].expand(len(own) * count, -1, *size)
    pixels, relative = other_pixels(seeing, flat_cameras(camera_frames(cameras, others)), depths)
    found = sampled(features[:, others].flatten(0, 1), pixels).unflatten(0, (-1, count))
    product = (found * own[:, None, :, None]).mean(2)
    return product, inside(pixels, relative).unflatten(0, (-1, count))
