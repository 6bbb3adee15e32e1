"""A video with its cameras, which refinement takes beside latents.

Axes: ``b`` batch, ``f`` video frames, ``k`` key frames, ``c`` channels, ``h w`` pixels. Key frames
are the last of every pack of four, 0, 4, 8, …: each latent frame has one. With refinement only they
have Gaussians, since the others show the same surfaces.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.geometry.camera import Camera
from diff4splat.models.config.networks import TIME_STRIDE


@dataclass(frozen=True, slots=True, kw_only=True)
class StartDistance:
    """Raw ray distances of the key frames' pixels before LDRM corrects them (ADR 38)."""

    prior: Float[Tensor, "b k h w"]
    """By the depth prior, from each key frame alone."""
    parallax: Float[Tensor, "b k h w"]
    """The same, brought to agree with the other frames."""
    confidence: Float[Tensor, "b k h w"]
    """Of the parallax, 0 to 1."""

    def sample(self, index: int) -> "StartDistance":
        """One batch element, as a batch of one."""
        row = slice(index, index + 1)
        return StartDistance(
            prior=self.prior[row], parallax=self.parallax[row], confidence=self.confidence[row]
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PosedVideo:
    """Decoded or true video with one camera per frame."""

    rgb: Float[Tensor, "b 3 f h w"]
    """In [0, 1]; the first frame is the input image where there is one."""
    cameras: Camera
    """Batch shape (b, f), of the frames' size; the first of each is the identity."""
    start: StartDistance | None = None
    """Where key frames start; None is a plane, as are distances of 0."""

    def __post_init__(self) -> None:
        batch, _, *video = self.rgb.shape
        want, got = (batch, *video), (*self.cameras.batch_shape, *self.cameras.size_px)
        if tuple(want) != tuple(got):
            raise ShapeError(
                f"PosedVideo.cameras: expected batch, frames and size {want}, got {got}; "
                "give every frame its camera"
            )

    def sample(self, index: int) -> "PosedVideo":
        """One batch element, as a batch of one."""
        row, start = slice(index, index + 1), self.start
        return PosedVideo(
            rgb=self.rgb[row],
            cameras=self.cameras[row],
            start=None if start is None else start.sample(index),
        )

    def start_or_plane(self) -> StartDistance:
        """Where key frames start; planes without a depth prior."""
        if self.start is not None:
            return self.start
        zero = torch.zeros_like(self.key_rgb[:, :, 0])
        return StartDistance(prior=zero, parallax=zero, confidence=zero)

    @property
    def keys(self) -> Int[Tensor, " k"]:
        """Frame numbers of the key frames."""
        return torch.arange(0, self.rgb.shape[2], TIME_STRIDE, device=self.rgb.device)

    @property
    def key_rgb(self) -> Float[Tensor, "b k 3 h w"]:
        """Colours of the key frames."""
        return self.rgb[:, :, ::TIME_STRIDE].transpose(1, 2)

    @property
    def key_cameras(self) -> Camera:
        """Cameras of the key frames, batch shape (b, k)."""
        return camera_frames(self.cameras, self.keys)


def camera_frames(cameras: Camera, frames: Int[Tensor, " m"]) -> Camera:
    """Some frames of cameras of batch shape (b, f)."""
    return replace(
        cameras,
        focal_px=cameras.focal_px[:, frames],
        center_px=cameras.center_px[:, frames],
        world_from_camera=cameras.world_from_camera[:, frames],
    )


def flat_cameras(cameras: Camera) -> Camera:
    """Cameras of batch shape (b, m) as one row of b m."""
    return replace(
        cameras,
        focal_px=cameras.focal_px.flatten(0, 1),
        center_px=cameras.center_px.flatten(0, 1),
        world_from_camera=cameras.world_from_camera.flatten(0, 1),
    )
