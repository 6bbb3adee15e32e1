"""Small images, layers and cameras for tests of the layered image."""

import torch
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.types import ImageLayer, LayeredImage
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.paths.camera_path import CameraPath

FOCAL_PX = 20.0
FAR_RANGES = ((1e-4, 1e5), (1e-3, 1e-2), (1.0, 1.0), (1e4, 1e8))
"""Nearest and farthest depth; the first spans nine decades."""


def random_rgb(height: int, width: int, seed: int = 0) -> Tensor:
    return torch.rand(height, width, 3, generator=torch.Generator().manual_seed(seed))


def random_depth(height: int, width: int, limits: tuple[float, float], seed: int = 0) -> Tensor:
    """Uniform in the logarithm between the limits."""
    share = torch.rand(height, width, generator=torch.Generator().manual_seed(seed))
    low, high = (torch.tensor(limit).log() for limit in limits)
    return torch.lerp(low, high, share).exp()


def input_image(rgb: Tensor, focal_px: float = FOCAL_PX) -> InputImage:
    height, width = rgb.shape[:2]
    return InputImage(rgb=rgb, camera=pinhole(focal_px, (height, width)), focal_source="test")


def layer(depth: Tensor, **changes: object) -> ImageLayer:
    """A layer of random colours at ``depth`` whose cells are all valid."""
    size = (depth.shape[0], depth.shape[1])
    fields = {
        "camera": pinhole(FOCAL_PX, size).to(depth.dtype),
        "rgb": random_rgb(*size).to(depth),
        "depth": depth,
        "mask": torch.ones(size, dtype=torch.bool),
        "opacity": 0.9,
        "footprint_px": 0.5,
    }
    return ImageLayer(**fields | changes)


RED, GREEN = torch.tensor([0.9, 0.1, 0.1]), torch.tensor([0.1, 0.7, 0.1])
"""Colours of an object and of what is behind it."""
RIM_SIZE_PX = (24, 28)


def square_mask(first: int, last: int) -> Tensor:
    """A square in an image of ``RIM_SIZE_PX``, from row and column ``first`` up to ``last``."""
    mask = torch.zeros(RIM_SIZE_PX, dtype=torch.bool)
    mask[first:last, first:last] = True
    return mask


def box_mask(side: int = 48) -> Tensor:
    """A box of 12 × 16 pixels."""
    mask = torch.zeros(side, side, dtype=torch.bool)
    mask[18:30, 14:30] = True
    return mask


def layered(*layers: ImageLayer) -> LayeredImage:
    return LayeredImage(layers=layers)


def sliding_path(camera: Camera, frames: int, step: tuple[float, float, float]) -> CameraPath:
    """Without turning, by ``step`` a frame; one frame per second."""
    poses = torch.eye(4).repeat(frames, 1, 1)
    poses[:, :3, 3] = torch.arange(frames)[:, None] * torch.tensor(step)
    return CameraPath(cameras=camera.with_pose(poses), times_s=torch.arange(float(frames)))


def is_finite(image: ImageLayer) -> bool:
    """No NaN and no infinity in what becomes Gaussians."""
    maps = [image.rgb, image.depth, *([] if image.displacement is None else [image.displacement])]
    return all(bool(each.isfinite().all()) for each in maps) and bool((image.depth > 0).all())
