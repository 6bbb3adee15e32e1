"""How frames of a capture are made from a scene: drawn as pinholes are, or by rays.

Axes: ``h w`` pixels, ``n`` Gaussians. A frame through optics is made of the whole scene, since each
of its rows may have a time of its own; one without is made of the state at its time.
"""

from dataclasses import dataclass, field

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture, Frame
from diff4splat.errors import ConfigError
from diff4splat.fitting.optics.camera_model import CameraModel, model_of, shows
from diff4splat.fitting.settings import CameraSettings
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.physical.api import photograph
from diff4splat.render.physical.settings import Photograph, PhotoSettings
from diff4splat.render.physical.view_cone import view_cone
from diff4splat.render.settings import RenderSettings
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

TRACE = "trace"
_STEP_SEED, _SHOWN_SEED = 1_000_003, 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """What makes the pictures of a fit.

    Raises:
        ConfigError: a rasteriser is asked for pictures that only rays can make.
    """

    capture: Capture
    backend: str = "auto"
    settings: CameraSettings = field(default_factory=CameraSettings)

    def __post_init__(self) -> None:
        if self.backend in ("auto", TRACE):
            return
        if shows(self.capture.optics):
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
        """Whether frames are photographs; else the rasteriser draws them."""
        asked = self.backend == TRACE or bool(self.settings.learn)
        return asked or (self.backend == "auto" and shows(self.capture.optics))

    def camera(self, index: int, known: CameraModel | None = None) -> PhysicalCamera:
        """The camera of a frame; as the capture says unless more is ``known`` by now."""
        return (known or model_of(self.capture)).camera(self.capture, index)

    def step_seed(self, number: int, index: int) -> int:
        """Of the samples of a frame in a step: other ones each time, the same in each run."""
        return _STEP_SEED * (number + 1) + index

    def learn(
        self, scene: Scene, camera: PhysicalCamera, index: int, outputs: set[str], seed: int
    ) -> Photograph:
        """A frame with few rays per pixel, for its gradients."""
        settings = self._photo(
            samples=self.settings.samples,
            seed=seed,
            tolerance_px=self.settings.tolerance_px,
            most_intervals=self.settings.most_intervals,
        )
        return self._taken(scene, camera, index, outputs, settings)

    @torch.no_grad()
    def show(self, scene: Scene, camera: PhysicalCamera, index: int) -> Photograph:
        """A frame to be looked at."""
        settings = self._photo(samples=self.settings.shown_samples, seed=_SHOWN_SEED)
        return self._taken(scene, camera, index, {"rgb"}, settings)

    def standing(self, gaussians: Gaussians, camera: PhysicalCamera, index: int) -> Photograph:
        """A frame of something that does not move, with few rays per pixel."""
        settings = self._photo(samples=self.settings.samples, seed=_SHOWN_SEED)
        return self._taken(gaussians, camera, index, {"rgb"}, settings)

    @property
    def drawing(self) -> str:
        """The back end for what rays do not make."""
        return "auto" if self.backend == TRACE else self.backend

    @property
    def path(self) -> CameraPath:
        """Scenes suggest one; nobody looks along it while they are fitted."""
        capture = self.capture
        return CameraPath(cameras=capture.cameras[:1], times_s=capture.times_s[:1])

    @property
    def background(self) -> tuple[float, float, float]:
        """What lies behind the scene."""
        return self.capture.background or (0.0, 0.0, 0.0)

    def _photo(self, **changes) -> PhotoSettings:
        return PhotoSettings(
            trace=TraceSettings(background=self.background),
            raster=RenderSettings(background=self.background),
            **changes,
        )

    def _taken(
        self,
        subject: Scene | Gaussians,
        camera: PhysicalCamera,
        index: int,
        outputs: set[str],
        settings: PhotoSettings,
    ) -> Photograph:
        # Where no effect shows there is nothing to learn of it, but there are focal lengths.
        backend = TRACE if self.backend == TRACE or "focal" in self.settings.learn else "auto"
        time_s = float(self.capture.times_s[index])
        return photograph(
            subject, camera, time_s, outputs=outputs, settings=settings, backend=backend
        )


def counted(frame: Frame, seen: Bool[Tensor, "h w"]) -> Bool[Tensor, "h w"] | None:
    """Pixels that count and that the lens sees; None where all do."""
    if bool(seen.all()):
        return frame.counts
    return seen if frame.counts is None else seen & frame.counts


def half_pictures(
    places: Float[Tensor, "n 3"], cameras: list[PhysicalCamera], time_s: float
) -> Float[Tensor, " n"]:
    """Scene units per half picture at each place, meaned over cameras; 0 behind a camera.

    An arc of half the picture's pixels at the distance of the place: ½ |place − camera|, the rule
    of 3DGRT, where half of the picture is half a radian wide.
    """
    total = places.new_zeros(len(places))
    for camera in cameras:
        own = camera.to(places.dtype)
        cone = view_cone(own, time_s)
        away = places - cone.position
        distance = away.norm(dim=-1)
        ahead = away @ cone.ahead >= min(cone.least_cosine, 0.0) * distance
        half = 0.5 * own.camera.size_px[1] / cone.pixels_per_radian
        total = total + torch.where(ahead, distance * half, 0.0)
    return total / len(cameras)
