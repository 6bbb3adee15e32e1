"""How well a scene shows frames that it has not seen.

Axes: ``h w`` pixels. As published comparisons do: pictures of eight bits, one PSNR and SSIM per
frame, then the mean; PSNR over all pixels that count and that the lens sees.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture, Frame
from diff4splat.fitting.frame_renderer import Sight, counted
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.fitting.pictures import FrameStore
from diff4splat.metrics.image import psnr
from diff4splat.metrics.ssim import WINDOW_PX, ssim
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

BEST_PSNR_DB = 99.0
"""Of equal pictures, whose PSNR is infinite."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameQuality:
    """One frame."""

    frame: int
    camera: int
    time_s: float
    psnr_db: float
    ssim: float | None
    """None where the picture is smaller than the window, or was not asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Judge:
    """Makes frames of a capture and compares."""

    sight: Sight
    store: FrameStore

    def frames(
        self,
        scene: Scene,
        known: CameraModel | None,
        indices: Sequence[int],
        with_ssim: bool = False,
        advance: Callable[[], None] = lambda: None,
    ) -> list[FrameQuality]:
        """Quality of each frame, through cameras as far as they are ``known``."""
        found = []
        for index in indices:
            made, seen = self.picture(scene, known, index)
            frame = self.store.read(index)
            frame = replace(frame, counts=counted(frame, seen))
            found.append(self._compare(made, frame, index, with_ssim))
            advance()
        return found

    @torch.no_grad()
    def picture(
        self, scene: Scene, known: CameraModel | None, index: int
    ) -> tuple[Float[Tensor, "h w 3"], Bool[Tensor, "h w"]]:
        """What the scene shows in place of a frame, rounded to eight bits, and where."""
        if self.sight.traced:
            made = self.sight.show(scene, self.sight.camera(index, known), index)
            rgb, seen = made.rgb, made.valid
        else:
            rgb = self._drawn(scene.state_at(float(self.capture.times_s[index])), index)
            seen = torch.ones(rgb.shape[:2], dtype=torch.bool)
        return (rgb.clamp(0, 1) * 255).round() / 255, seen

    @property
    def capture(self) -> Capture:
        """What is compared with."""
        return self.sight.capture

    def _drawn(self, state: Gaussians, index: int) -> Float[Tensor, "h w 3"]:
        settings = RenderSettings(background=self.sight.background)
        camera = self.capture.cameras[index]
        return render(state, camera, settings=settings, backend=self.sight.drawing).rgb

    def _compare(
        self, made: Float[Tensor, "h w 3"], frame: Frame, index: int, with_ssim: bool
    ) -> FrameQuality:
        structure = None
        if with_ssim and min(made.shape[:2]) >= WINDOW_PX:
            structure = float(ssim(made, frame.rgb))
        return FrameQuality(
            frame=index,
            camera=int(self.capture.camera_index[index]),
            time_s=float(self.capture.times_s[index]),
            psnr_db=min(_psnr(made, frame), BEST_PSNR_DB),
            ssim=structure,
        )


def mean_psnr_db(qualities: Sequence[FrameQuality]) -> float | None:
    """Mean over frames; None without frames."""
    if not qualities:
        return None
    return sum(quality.psnr_db for quality in qualities) / len(qualities)


def _psnr(made: Float[Tensor, "h w 3"], frame: Frame) -> float:
    if frame.counts is None:
        return float(psnr(made, frame.rgb))
    error = (made - frame.rgb)[frame.counts].double().square().mean()
    return float(-10 * torch.log10(error)) if error > 0 else BEST_PSNR_DB
