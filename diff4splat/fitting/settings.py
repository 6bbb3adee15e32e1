"""Everything that decides how a scene is fitted, with where each number comes from.

Rates are those of Kerbl et al. (SIGGRAPH 2023) and Wu et al. (CVPR 2024, arXiv 2310.08528), code
and appendix, raised where a fit of minutes in place of hours needs it. Lengths are in shares of
the extent of the scene.
"""

from dataclasses import dataclass, field
from typing import Literal

from diff4splat.errors import ConfigError
from diff4splat.scene.motion.hexplane.decoder import DecoderSize
from diff4splat.scene.motion.hexplane.planes import HexPlaneSize

MotionName = Literal["hexplane", "spacetime", "static"]
CameraPart = Literal["lens", "focus", "aperture", "readout", "focal"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """A learning rate that falls log-linearly over its stage."""

    first: float
    last: float

    def at(self, progress: float) -> float:
        """The rate after a share of the stage."""
        return self.first * (self.last / self.first) ** min(max(progress, 0.0), 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates:
    """Learning rates; lengths are multiplied by the extent of the scene."""

    means: Decay = Decay(first=8e-4, last=8e-6)
    log_scales: Decay = Decay(first=1e-2, last=2e-3)
    quats: Decay = Decay(first=4e-3, last=1e-3)
    opacity_logits: Decay = Decay(first=5e-2, last=1e-2)
    sh_dc: Decay = Decay(first=1e-2, last=1e-3)
    sh_rest: Decay = Decay(first=5e-4, last=5e-5)
    planes: Decay = Decay(first=1e-2, last=5e-4)
    decoder: Decay = Decay(first=1e-3, last=5e-5)
    velocities: Decay = Decay(first=1e-2, last=1e-4)
    times: Decay = Decay(first=1e-2, last=1e-3)
    lens: Decay = Decay(first=5e-2, last=2e-3)
    """In pixels of displacement."""
    focus: Decay = Decay(first=1e-2, last=5e-4)
    """Of logarithms, as the next three."""
    aperture: Decay = Decay(first=1e-2, last=5e-4)
    readout: Decay = Decay(first=2e-2, last=1e-3)
    focal: Decay = Decay(first=2e-3, last=1e-4)


@dataclass(frozen=True, slots=True, kw_only=True)
class Density:
    """How Gaussians are added and removed."""

    budget: int = 40_000
    """Never more Gaussians than this."""
    every: int = 100
    growth: float = 0.12
    """Share of Gaussians that is split each time, at the most."""
    until: float = 0.6
    """Of the stage; afterwards the number stays."""
    min_opacity: float = 0.005
    min_gradient: float = 2e-5
    """Of a mean, in half pictures per loss: below it nothing is split."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """Of the terms of the loss beside the mean absolute error of colours."""

    ssim: float = 0.0
    depth: float = 0.1
    flow: float = 0.0
    smooth_space: float = 2e-4
    smooth_time: float = 1e-3
    time_planes: float = 1e-4
    opacity: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Stillness:
    """Which Gaussians the motion has to carry; the others are left out of it."""

    min_score: float = 0.08
    """How much more error at its worst time than at its best a standing Gaussian may have."""
    offset_px: float = 0.1
    """A Gaussian that never goes further than this from its mean place stands still."""
    change: float = 0.02
    """The same for opacity and colour."""
    checks: tuple[float, ...] = (0.5, 1.0)
    """Shares of the fine stage after which Gaussians that proved still are taken out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSettings:
    """What is learned of the cameras, and how rays make pictures where rays are needed."""

    learn: tuple[CameraPart, ...] = ()
    """Parts that the capture only guesses: they start from there."""
    start: int = 100
    """Steps of the whole fit before they are learned: first the scene has to be there."""
    samples: int = 8
    """Rays per pixel in a step, where an aperture or an exposure needs several; other ones each
    time. Fewer are faster and noisier."""
    shown_samples: int = 64
    """The same for pictures that are judged and shown."""
    tolerance_px: float = 0.3
    """How far anything may be from its place at the time of a ray, in a step."""
    most_intervals: int = 4
    """Into which the time of a picture is split in a step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """One fit."""

    motion: MotionName = "hexplane"
    seed: int = 0
    coarse_steps: int = 1000
    """Without motion, all times as if they were one."""
    fine_steps: int = 2500
    views_per_step: int = 2
    """Pictures of one time per step: they share the state."""
    harmonics: int = 1
    """Highest degree of view-dependent colour; raised by one every ``harmonics_every`` steps."""
    harmonics_every: int = 500
    points: int = 20_000
    """To start from, where the capture has more."""
    use_depth: bool = True
    """Start from depth, and compare with it, where the capture has any."""
    rates: Rates = field(default_factory=Rates)
    density: Density = field(default_factory=Density)
    weights: Weights = field(default_factory=Weights)
    stillness: Stillness = field(default_factory=Stillness)
    camera: CameraSettings = field(default_factory=CameraSettings)
    planes: HexPlaneSize = field(default_factory=lambda: HexPlaneSize(space=(32, 32, 32), time=25))
    decoder: DecoderSize = field(
        default_factory=lambda: DecoderSize(
            width=32, heads=("position", "rotation", "scale", "opacity", "color")
        )
    )
    time_slices: int = 8
    """Native 4D: pulses that share the time range at the start."""
    picture_memory_mb: int = 1024
    """Pictures kept in memory; the others are read again when they are needed."""
    checkpoint_every: int = 1000
    judge_every: int = 500

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
