"""Videos of a textured plane that faces a camera moving sideways."""

import torch
from torch import Tensor

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo

SIZE, FOCAL_PX, DEPTH = (48, 64), 60.0, 5.0
INNER = (..., slice(12, -12), slice(12, -12))


def texture(x: Tensor, y: Tensor) -> Tensor:
    """Smooth colours of a point (x, y) of the plane."""
    waves = [
        torch.sin(3.1 * x + 1.3 * y),
        torch.sin(2.3 * y - 1.1 * x + 1),
        torch.cos(2.7 * x) * torch.sin(2.9 * y),
    ]
    return 0.5 + 0.4 * torch.stack(waves)


def plane_video(step: float, frames: int = 9, bare: float = 0.0) -> PosedVideo:
    """A camera that moves sideways by ``step`` a frame before a plane at DEPTH.

    Within ``bare`` of its middle the plane has one colour.
    """
    rows, columns = (torch.arange(side) + 0.5 for side in SIZE)
    y, x = torch.meshgrid(rows, columns, indexing="ij")
    x, y = (x - SIZE[1] / 2) * DEPTH / FOCAL_PX, (y - SIZE[0] / 2) * DEPTH / FOCAL_PX
    views = [(x + step * frame, y) for frame in range(frames)]
    near = [((x.square() + y.square()) < bare**2)[None] for x, y in views]
    images = [torch.where(one, 0.5, texture(*view)) for one, view in zip(near, views, strict=True)]
    rgb = torch.stack(images, 1)
    return PosedVideo(rgb=rgb[None], cameras=sliding_cameras(step, frames))


def sliding_cameras(step: float, frames: int) -> Camera:
    poses = torch.eye(4).repeat(1, frames, 1, 1)
    poses[..., 0, 3] = step * torch.arange(frames)
    return pinhole(FOCAL_PX, SIZE).with_pose(poses)
