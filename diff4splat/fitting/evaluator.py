"""Image quality of a scene on frames of its capture.

Axes: ``h w`` pixels. The protocol of published comparisons: 8-bit images, one PSNR and SSIM per
frame, then the mean over frames. PSNR covers the valid pixels only.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture, Frame
from diff4splat.fitting.frames.frame_renderer import FrameRenderer, loss_mask
from diff4splat.fitting.frames.frame_store import FrameStore
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.metrics.image import psnr
from diff4splat.metrics.ssim import WINDOW_PX, ssim
from diff4splat.scene.scene import Scene

MAX_PSNR_DB = 99.0
"""Reported for identical images, whose PSNR is infinite."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameQuality:
    """Quality of one frame."""

    frame: int
    camera: int
    time_s: float
    psnr_db: float
    ssim: float | None
    """None if not requested, or if the image is smaller than the SSIM window."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluator:
    """Renders frames of a capture and compares them with the ground truth."""

    renderer: FrameRenderer
    store: FrameStore

    def frames(
        self,
        scene: Scene,
        cameras: CameraModel | None,
        indices: Sequence[int],
        with_ssim: bool = False,
        advance: Callable[[], None] = lambda: None,
    ) -> list[FrameQuality]:
        """Quality of each frame; ``cameras`` replaces the optics of the capture if given."""
        qualities = []
        for index in indices:
            rgb, valid = self.image(scene, cameras, index)
            frame = self.store.read(index)
            frame = replace(frame, counts=loss_mask(frame, valid))
            qualities.append(self._compare(rgb, frame, index, with_ssim))
            advance()
        return qualities

    @torch.no_grad()
    def image(
        self, scene: Scene, cameras: CameraModel | None, index: int
    ) -> tuple[Float[Tensor, "h w 3"], Bool[Tensor, "h w"]]:
        """The rendering of a frame, rounded to 8 bits, and its mask of valid pixels."""
        if self.renderer.traced:
            photo = self.renderer.show(scene, self.renderer.camera(index, cameras), index)
            rgb, valid = photo.rgb, photo.valid
        else:
            state = scene.state_at(float(self.capture.times_s[index]))
            rgb = self.renderer.rasterize(state, index).rgb
            valid = torch.ones(rgb.shape[:2], dtype=torch.bool)
        return (rgb.clamp(0, 1) * 255).round() / 255, valid

    @property
    def capture(self) -> Capture:
        """The ground truth."""
        return self.renderer.capture

    def _compare(
        self, rgb: Float[Tensor, "h w 3"], frame: Frame, index: int, with_ssim: bool
    ) -> FrameQuality:
        similarity = None
        if with_ssim and min(rgb.shape[:2]) >= WINDOW_PX:
            similarity = float(ssim(rgb, frame.rgb))
        return FrameQuality(
            frame=index,
            camera=int(self.capture.camera_index[index]),
            time_s=float(self.capture.times_s[index]),
            psnr_db=min(_psnr(rgb, frame), MAX_PSNR_DB),
            ssim=similarity,
        )


def mean_psnr_db(qualities: Sequence[FrameQuality]) -> float | None:
    """Mean over frames; None without frames."""
    if not qualities:
        return None
    return sum(quality.psnr_db for quality in qualities) / len(qualities)


def _psnr(rgb: Float[Tensor, "h w 3"], frame: Frame) -> float:
    if frame.counts is None:
        return float(psnr(rgb, frame.rgb))
    error = (rgb - frame.rgb)[frame.counts].double().square().mean()
    return float(-10 * torch.log10(error)) if error > 0 else MAX_PSNR_DB
