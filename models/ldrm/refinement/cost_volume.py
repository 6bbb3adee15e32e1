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
    keys = torch.arange(0, features.shape[1], TIME_STRIDE, device=features.device)
    others = _other_frames(keys, features.shape[1])
    if others.shape[1] == 0:
        height, width = features.shape[-2:]
        shape = (len(features), len(keys), 2 * len(inverse_depths), height, width)
        return features.new_full(shape, UNSEEN)
    agreement, visible = _compare(features, cameras, inverse_depths, (keys, others))
    count = visible.sum(2)
    mean = (agreement * visible).sum(2) / count.clamp_min(1)
    best = agreement.masked_fill(~visible, UNSEEN).amax(2)
    return torch.cat([torch.where(count > 0, mean, UNSEEN), best], 2)


def _other_frames(keys: Int[Tensor, " k"], frames: int) -> Int[Tensor, "k s"]:
    """Every second frame but the key frame itself."""
    slots = STEP * torch.arange((frames - 1) // STEP, device=keys.device)
    return slots + STEP * (slots >= keys[:, None])


def _compare(
    features: Tensor,
    cameras: Camera,
    inverse_depths: Tensor,
    frames: tuple[Int[Tensor, " k"], Int[Tensor, "k s"]],
) -> tuple[Float[Tensor, "b k s d h w"], Tensor]:
    """Scalar products, and in which frames each point is visible."""
    keys, others = frames
    batch, size = features.shape[0], features.shape[-2:]
    source = flat_cameras(camera_frames(cameras, keys[:, None].expand_as(others).flatten()))
    other = flat_cameras(camera_frames(cameras, others.flatten()))
    depths = inverse_depths[None, :, None, None].expand(batch * others.numel(), -1, *size)
    pixels, relative = other_pixels(source, other, depths)
    pairs = (batch, *others.shape)
    warped = sampled(features[:, others.flatten()].flatten(0, 1), pixels).unflatten(0, pairs)
    product = (warped * features[:, keys, None, :, None]).mean(3)
    return product, inside(pixels, relative).unflatten(0, pairs)
