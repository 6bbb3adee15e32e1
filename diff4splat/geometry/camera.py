"""Pinhole cameras: intrinsics in pixels of a stated size, plus a pose.

Axes: ``*b`` batch (none for one camera, ``t`` for a path). Pixel (row i, column j) has its centre
at (x, y) = (j + 0.5, i + 0.5). In OpenCV camera axes: u = f_x x/z + c_x, v = f_y y/z + c_y. Behind
another lens than a pinhole, focal lengths are pixels per unit of that lens's image plane.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.geometry import rigid

FULL_FRAME_DIAGONAL_MM = math.hypot(36.0, 24.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """One pinhole camera, or a batch of cameras that share an image size."""

    focal_px: Float[Tensor, "*b 2"]
    """(f_x, f_y)"""
    center_px: Float[Tensor, "*b 2"]
    """Principal point (c_x, c_y); the middle of the image is (width / 2, height / 2)."""
    world_from_camera: Float[Tensor, "*b 4 4"]
    size_px: tuple[int, int]
    """(height, width)"""

    def __post_init__(self) -> None:
        lead = tuple(self.world_from_camera.shape[:-2])
        want = {"world_from_camera": (*lead, 4, 4), "focal_px": (*lead, 2), "center_px": (*lead, 2)}
        for name, shape in want.items():
            got = tuple(getattr(self, name).shape)
            if got != shape:
                raise ShapeError(f"Camera.{name}: expected {shape}, got {got}")
        if len(self.size_px) != 2 or min(self.size_px) < 1:
            raise ShapeError(
                f"Camera.size_px: expected (height, width) of at least 1, got {self.size_px}"
            )

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """Leading shape: () for one camera, (t,) for a path."""
        return tuple(self.world_from_camera.shape[:-2])

    @property
    def camera_from_world(self) -> Float[Tensor, "*b 4 4"]:
        """The inverse pose."""
        return rigid.invert(self.world_from_camera)

    @property
    def position(self) -> Float[Tensor, "*b 3"]:
        """Camera centres in world space."""
        return self.world_from_camera[..., :3, 3]

    def __len__(self) -> int:
        return self.batch_shape[0]

    def __getitem__(self, index: int | slice | Int[Tensor, " m"]) -> "Camera":
        return replace(
            self,
            focal_px=self.focal_px[index],
            center_px=self.center_px[index],
            world_from_camera=self.world_from_camera[index],
        )

    def to(self, target: torch.device | torch.dtype) -> "Camera":
        """Move or cast every tensor."""
        return replace(
            self,
            focal_px=self.focal_px.to(target),
            center_px=self.center_px.to(target),
            world_from_camera=self.world_from_camera.to(target),
        )

    def with_pose(self, world_from_camera: Float[Tensor, "*c 4 4"]) -> "Camera":
        """The same lens at other poses; intrinsics are broadcast over them."""
        lead = world_from_camera.shape[:-2]
        return replace(
            self,
            focal_px=self.focal_px.expand(*lead, 2),
            center_px=self.center_px.expand(*lead, 2),
            world_from_camera=world_from_camera,
        )

    def resized(self, size_px: tuple[int, int]) -> "Camera":
        """The same view in an image of another (height, width)."""
        factor = self.focal_px.new_tensor(
            [size_px[1] / self.size_px[1], size_px[0] / self.size_px[0]]
        )
        return replace(
            self,
            focal_px=self.focal_px * factor,
            center_px=self.center_px * factor,
            size_px=size_px,
        )

    def cropped(self, top_left_px: tuple[int, int], size_px: tuple[int, int]) -> "Camera":
        """The view through a window: ``top_left_px`` (row, column), ``size_px`` (height, width)."""
        offset = self.center_px.new_tensor([top_left_px[1], top_left_px[0]])
        return replace(self, center_px=self.center_px - offset, size_px=size_px)


def pinhole(
    focal_px: float, size_px: tuple[int, int], dtype: torch.dtype = torch.float32
) -> Camera:
    """A camera at the origin with square pixels and the principal point in the middle."""
    height, width = size_px
    return Camera(
        focal_px=torch.tensor([focal_px, focal_px], dtype=dtype),
        center_px=torch.tensor([width / 2, height / 2], dtype=dtype),
        world_from_camera=torch.eye(4, dtype=dtype),
        size_px=size_px,
    )


def stack_cameras(cameras: Sequence[Camera]) -> Camera:
    """Cameras of one batch shape along a new leading axis."""
    return _combined(cameras, torch.stack)


def join_cameras(cameras: Sequence[Camera]) -> Camera:
    """Batches of cameras one after the other."""
    return _combined(cameras, torch.cat)


def _combined(cameras: Sequence[Camera], combine: Callable[[list[Tensor]], Tensor]) -> Camera:
    sizes = {camera.size_px for camera in cameras}
    if len(sizes) != 1:
        raise ShapeError(f"cameras: expected one image size, got {sorted(sizes)}; resize them")
    return Camera(
        focal_px=combine([camera.focal_px for camera in cameras]),
        center_px=combine([camera.center_px for camera in cameras]),
        world_from_camera=combine([camera.world_from_camera for camera in cameras]),
        size_px=cameras[0].size_px,
    )


def project(
    camera: Camera, points: Float[Tensor, "*b n 3"]
) -> tuple[Float[Tensor, "*b n 2"], Float[Tensor, "*b n"]]:
    """World points to pixel coordinates (x, y) and z-depth.

    Points on the camera plane give very large but finite coordinates; points behind it have z < 0
    and mirrored coordinates, so callers must look at z.
    """
    local = rigid.transform_points(camera.camera_from_world, points)
    z = local[..., 2]
    safe = torch.where(z.abs() > 1e-12, z, torch.full_like(z, 1e-12))
    pixels = (
        local[..., :2] / safe[..., None] * camera.focal_px[..., None, :]
        + camera.center_px[..., None, :]
    )
    return pixels, z


def focal_from_fov(fov_deg: float, width_px: int) -> float:
    """Focal length in pixels of a horizontal field of view."""
    return 0.5 * width_px / math.tan(math.radians(fov_deg) / 2)


def focal_from_35mm(focal_35mm: float, size_px: tuple[int, int]) -> float:
    """Focal length in pixels of a 35 mm equivalent, by the diagonal (EXIF 2.3, tag 0xA405)."""
    return focal_35mm * math.hypot(*size_px) / FULL_FRAME_DIAGONAL_MM
