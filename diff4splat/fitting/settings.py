"""Settings of a fit, with the source of each number.

Rates are those of Kerbl et al. (SIGGRAPH 2023) and Wu et al. (CVPR 2024, arXiv 2310.08528), code
and appendix, raised for fits of minutes instead of hours. Lengths are shares of the extent of the
scene.
"""

from dataclasses import dataclass, field
from typing import Literal

import torch

from diff4splat.errors import ConfigError
from diff4splat.scene.motion.hexplane.decoder import DecoderSize
from diff4splat.scene.motion.hexplane.planes import HexPlaneSize

MotionName = Literal["hexplane", "spacetime", "static"]
DtypeName = Literal["float32", "float64"]
CameraPart = Literal["lens", "focus", "aperture", "readout", "focal"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogLinearDecay:
    """A learning rate that decays log-linearly over its stage."""

    first: float
    last: float

    def at(self, progress: float) -> float:
        """The rate after the share ``progress`` of the stage."""
        return self.first * (self.last / self.first) ** min(max(progress, 0.0), 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LearningRates:
    """Learning rates; lengths are multiplied by the extent of the scene."""

    means: LogLinearDecay = LogLinearDecay(first=8e-4, last=8e-6)
    log_scales: LogLinearDecay = LogLinearDecay(first=1e-2, last=2e-3)
    quats: LogLinearDecay = LogLinearDecay(first=4e-3, last=1e-3)
    opacity_logits: LogLinearDecay = LogLinearDecay(first=5e-2, last=1e-2)
    sh_dc: LogLinearDecay = LogLinearDecay(first=1e-2, last=1e-3)
    sh_rest: LogLinearDecay = LogLinearDecay(first=5e-4, last=5e-5)
    planes: LogLinearDecay = LogLinearDecay(first=1e-2, last=5e-4)
    decoder: LogLinearDecay = LogLinearDecay(first=1e-3, last=5e-5)
    velocities: LogLinearDecay = LogLinearDecay(first=1e-2, last=1e-4)
    times: LogLinearDecay = LogLinearDecay(first=1e-2, last=1e-3)
    lens: LogLinearDecay = LogLinearDecay(first=5e-2, last=2e-3)
    """In pixels of displacement."""
    focus: LogLinearDecay = LogLinearDecay(first=1e-2, last=5e-4)
    """Of the logarithm, as for the next three."""
    aperture: LogLinearDecay = LogLinearDecay(first=1e-2, last=5e-4)
    readout: LogLinearDecay = LogLinearDecay(first=2e-2, last=1e-3)
    focal: LogLinearDecay = LogLinearDecay(first=2e-3, last=1e-4)


@dataclass(frozen=True, slots=True, kw_only=True)
class DensitySettings:
    """Density control: how Gaussians are added and removed."""

    budget: int = 40_000
    """Largest number of Gaussians."""
    every: int = 100
    growth: float = 0.12
    """Largest share of Gaussians that one step splits."""
    until: float = 0.6
    """Share of the stage after which the number of Gaussians is fixed."""
    min_opacity: float = 0.005
    min_gradient: float = 2e-5
    """Smallest gradient of a mean, in normalised device coordinates, for a split."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LossWeights:
    """Weights of the loss terms other than the mean absolute colour error."""

    ssim: float = 0.0
    depth: float = 0.1
    flow: float = 0.0
    smooth_space: float = 2e-4
    smooth_time: float = 1e-3
    time_planes: float = 1e-4
    opacity: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticDetectionSettings:
    """Which Gaussians are static and excluded from the motion."""

    min_score: float = 0.08
    """Largest error variation over time of a static Gaussian, in the static scene."""
    offset_px: float = 0.1
    """Largest displacement of a static Gaussian from its mean position."""
    change: float = 0.02
    """Largest change of opacity and colour of a static Gaussian."""
    checks: tuple[float, ...] = (0.5, 1.0)
    """Shares of the fine stage after which static Gaussians leave the motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSettings:
    """Learned camera parameters, and the quality of ray traced frames."""

    learn: tuple[CameraPart, ...] = ()
    """Parameters that the capture only estimates; the estimate is the initial value."""
    start: int = 100
    """First step of the fit that optimises the cameras; the scene converges first."""
    samples: int = 8
    """Rays per pixel in a step, for an aperture or an exposure; fewer are faster and noisier."""
    shown_samples: int = 64
    """Rays per pixel for evaluation and preview."""
    tolerance_px: float = 0.3
    """Largest position error from approximating the time of a ray, in a step."""
    most_intervals: int = 4
    """Largest number of time intervals per frame in a step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """All settings of one fit."""

    motion: MotionName = "hexplane"
    dtype: DtypeName = "float32"
    """Of parameters, optimiser, images and losses."""
    seed: int = 0
    coarse_steps: int = 1000
    """Steps without motion, over frames of all times."""
    fine_steps: int = 2500
    views_per_step: int = 2
    """Frames of one time per step; they share the state of the Gaussians."""
    harmonics: int = 1
    """Highest degree of view-dependent colour; raised by one every ``harmonics_every`` steps."""
    harmonics_every: int = 500
    points: int = 20_000
    """Largest number of initial points."""
    use_depth: bool = True
    """Initialise from depth and use a depth loss, if the capture has depth."""
    rates: LearningRates = field(default_factory=LearningRates)
    density: DensitySettings = field(default_factory=DensitySettings)
    weights: LossWeights = field(default_factory=LossWeights)
    stillness: StaticDetectionSettings = field(default_factory=StaticDetectionSettings)
    camera: CameraSettings = field(default_factory=CameraSettings)
    planes: HexPlaneSize = field(default_factory=lambda: HexPlaneSize(space=(32, 32, 32), time=25))
    decoder: DecoderSize = field(
        default_factory=lambda: DecoderSize(
            width=32, heads=("position", "rotation", "scale", "opacity", "color")
        )
    )
    time_slices: int = 8
    """Native 4D Gaussians: initial number of time slices."""
    picture_memory_mb: int = 1024
    """Cache for frames; others are read again when needed."""
    checkpoint_every: int = 1000
    judge_every: int = 500

    @property
    def torch_dtype(self) -> torch.dtype:
        """``dtype`` as PyTorch has it."""
        return torch.float64 if self.dtype == "float64" else torch.float32

    def __post_init__(self) -> None:
        counts = {
            "fine_steps": self.fine_steps, "views_per_step": self.views_per_step,
            "points": self.points, "density.budget": self.density.budget,
            "time_slices": self.time_slices,
            "picture_memory_mb": self.picture_memory_mb,
            "camera.samples": self.camera.samples,
            "camera.shown_samples": self.camera.shown_samples,
            "camera.most_intervals": self.camera.most_intervals,
        }  # fmt: skip
        for name, value in counts.items():
            if value < 1:
                raise ConfigError(f"{name}: expected at least 1, got {value}")
        if len(set(self.camera.learn)) < len(self.camera.learn):
            raise ConfigError(f"camera.learn: expected each part once, got {self.camera.learn}")
        checks = self.stillness.checks
        if not all(0 < share <= 1 for share in checks):
            raise ConfigError(
                f"stillness.checks: expected shares above 0 and up to 1, got {checks}"
            )
        if self.coarse_steps < 0 or not 0 <= self.harmonics <= 3:
            raise ConfigError(
                "coarse_steps and harmonics: expected at least 0 and 0 to 3, got "
                f"{self.coarse_steps} and {self.harmonics}"
            )
