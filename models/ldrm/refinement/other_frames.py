"""Other frames of a video, and what they show of the points that a key frame sees.

Axes: ``b`` batch, ``k`` key frames, ``n`` = b k, ``h w`` pixels.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, camera_frames, flat_cameras
from diff4splat.models.ldrm.refinement.warping import inside, other_pixels, sampled
from diff4splat.models.ldrm.window_mean import window_mean

DISTANCES = (2, 4, 8)
"""Frames between a key frame and those that it is compared with, before and after."""
BLUR_PX = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherFrames:
    """One other frame for each key frame."""

    rgb: Float[Tensor, "n 3 h w"]
    """Blurred."""
    cameras: Camera
    exists: Bool[Tensor, " n"]
    """False beyond the ends of the video."""

    def colors_at(
        self, log_depth: Float[Tensor, "n h w"], cameras: Camera
    ) -> tuple[Float[Tensor, "n 3 h w"], Bool[Tensor, "n h w"]]:
        """Colours here of the points that ``cameras`` see at that depth, and which are shown."""
        pixels, relative = other_pixels(cameras, self.cameras, (-log_depth).exp()[:, None])
        return sampled(self.rgb, pixels)[:, :, 0], inside(pixels, relative)[:, 0]


def blurred_key_frames(video: PosedVideo) -> Float[Tensor, "n 3 h w"]:
    """Key frames as other frames are blurred."""
    return window_mean(video.key_rgb.flatten(0, 1).float(), BLUR_PX)


def other_frames(video: PosedVideo) -> Iterator[OtherFrames]:
    """One for each distance and direction that some key frame has."""
    count, batch = video.rgb.shape[2], len(video.rgb)
    for distance in (sign * length for length in DISTANCES for sign in (1, -1)):
        frames = video.keys + distance
        exists = (frames >= 0) & (frames < count)
        if not exists.any():
            continue
        frames = frames.clamp(0, count - 1)
        rgb = video.rgb[:, :, frames].transpose(1, 2).flatten(0, 1).float()
        yield OtherFrames(
            rgb=window_mean(rgb, BLUR_PX),
            cameras=flat_cameras(camera_frames(video.cameras, frames)),
            exists=exists.repeat(batch),
        )
