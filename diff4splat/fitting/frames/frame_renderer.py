"""Renders a scene in place of a frame: rasterised through pinholes, or ray traced through optics.

Axes: ``h w`` pixels, ``n`` Gaussians. Ray tracing takes the whole scene, since a rolling shutter
gives each row its own time. Rasterisation takes the state at the time of the frame.
"""

from dataclasses import dataclass, field, fields, replace

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.capture.capture import Capture, Frame
from diff4splat.errors import ConfigError
from diff4splat.fitting.optics.camera_model import (
    CameraModel,
    camera_model_of,
    differs_from_pinhole,
)
from diff4splat.fitting.settings import CameraSettings
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render
from diff4splat.render.physical.api import photograph
from diff4splat.render.physical.settings import Photograph, PhotoSettings
from diff4splat.render.settings import RenderOutput, RenderSettings
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

TRACE = "trace"
_STEP_SEED, _PREVIEW_SEED = 1_000_003, 0


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameRenderer:
    """Renders frames of one capture with one back end.

    Raises:
        ConfigError: a rasteriser is requested for cameras that need ray tracing.
    """

    capture: Capture
    backend: str = "auto"
    settings: CameraSettings = field(default_factory=CameraSettings)
    device: str = "cpu"
    """Where frames are rasterised; Gaussians go there, images and gradients come back."""

    def __post_init__(self) -> None:
        if self.backend in ("auto", TRACE):
            return
        if differs_from_pinhole(self.capture.optics):
            raise ConfigError(
                f"--renderer {self.backend}: expected 'trace' or 'auto' for {self.capture.name}, "
                "whose cameras have a lens, an aperture, a read-out or an exposure; leave it out"
            )
        if self.settings.learn:
            raise ConfigError(
                f"--renderer {self.backend}: expected 'trace' or 'auto' to learn "
                f"{', '.join(self.settings.learn)}; leave it out"
            )

    @property
    def traced(self) -> bool:
        """Whether frames are ray traced; otherwise they are rasterised."""
        requested = self.backend == TRACE or bool(self.settings.learn)
        return requested or (self.backend == "auto" and differs_from_pinhole(self.capture.optics))

    def camera(self, index: int, cameras: CameraModel | None = None) -> PhysicalCamera:
        """The camera of a frame, with the optics of ``cameras`` or else of the capture."""
        return (cameras or camera_model_of(self.capture)).camera(self.capture, index)

    def step_seed(self, number: int, index: int) -> int:
        """Seed of the rays of a frame in one step: differs per step, repeats per run."""
        return _STEP_SEED * (number + 1) + index

    def learn(
        self, scene: Scene, camera: PhysicalCamera, index: int, outputs: set[str], seed: int
    ) -> Photograph:
        """A differentiable frame with few rays per pixel."""
        settings = self._photo_settings(
            samples=self.settings.samples,
            seed=seed,
            tolerance_px=self.settings.tolerance_px,
            most_intervals=self.settings.most_intervals,
        )
        return self._photograph(scene, camera, index, outputs, settings)

    @torch.no_grad()
    def show(self, scene: Scene, camera: PhysicalCamera, index: int) -> Photograph:
        """A frame with many rays per pixel, for evaluation."""
        settings = self._photo_settings(samples=self.settings.shown_samples, seed=_PREVIEW_SEED)
        return self._photograph(scene, camera, index, {"rgb"}, settings)

    def show_static(self, gaussians: Gaussians, camera: PhysicalCamera, index: int) -> Photograph:
        """A differentiable frame of static Gaussians with few rays per pixel."""
        settings = self._photo_settings(samples=self.settings.samples, seed=_PREVIEW_SEED)
        return self._photograph(gaussians, camera, index, {"rgb"}, settings)

    def rasterize(
        self, state: Gaussians, index: int, outputs: set[str] | None = None
    ) -> RenderOutput:
        """A frame of Gaussians at one time, through the pinhole camera of the capture."""
        output = render(
            state.to(torch.device(self.device)),
            self.capture.cameras[index],
            outputs=outputs or {"rgb"},
            settings=RenderSettings(background=self.background),
            backend=self.raster_backend,
        )
        return _on(state.means.device, output)

    @property
    def raster_backend(self) -> str:
        """The back end for outputs that ray tracing does not provide."""
        return "auto" if self.backend == TRACE else self.backend

    @property
    def path(self) -> CameraPath:
        """A placeholder path of one camera, since ``Scene`` requires one."""
        capture = self.capture
        return CameraPath(cameras=capture.cameras[:1], times_s=capture.times_s[:1])

    @property
    def background(self) -> tuple[float, float, float]:
        """Background colour; black unless the capture has one."""
        return self.capture.background or (0.0, 0.0, 0.0)

    def _photo_settings(self, **changes) -> PhotoSettings:
        return PhotoSettings(
            trace=TraceSettings(background=self.background),
            raster=RenderSettings(background=self.background),
            **changes,
        )

    def _photograph(
        self,
        subject: Scene | Gaussians,
        camera: PhysicalCamera,
        index: int,
        outputs: set[str],
        settings: PhotoSettings,
    ) -> Photograph:
        # "auto" may rasterise a camera without effects, which has no gradient for focal lengths.
        backend = TRACE if self.backend == TRACE or "focal" in self.settings.learn else "auto"
        time_s = float(self.capture.times_s[index])
        return photograph(
            subject, camera, time_s, outputs=outputs, settings=settings, backend=backend
        )


def _on(device: torch.device, output: RenderOutput) -> RenderOutput:
    values = {one.name: getattr(output, one.name) for one in fields(output)}
    moved = {name: one.to(device) for name, one in values.items() if isinstance(one, Tensor)}
    return replace(output, **moved)


def loss_mask(frame: Frame, valid: Bool[Tensor, "h w"]) -> Bool[Tensor, "h w"] | None:
    """Pixels that enter the loss: in the frame mask and covered by the lens; None for all."""
    if bool(valid.all()):
        return frame.counts
    return valid if frame.counts is None else valid & frame.counts
