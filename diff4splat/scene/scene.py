"""A scene is Gaussians plus a motion, with suggested cameras and a record of where it came from."""

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.protocol import Motion

DILATION_PX2 = 0.3
"""What Kerbl's renderer and most viewers add to footprints; scenes are fitted with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Where a scene came from; travels inside the scene file."""

    generator: str
    """Program and version, such as ``diff4splat 0.1.0``."""
    model: str = "none"
    weights_sha256: str = "none"
    seed: int | None = None
    prompt: str | None = None
    license: str = "unknown"
    untrained: bool = False
    """True while the weights are random: the scene shows the photograph on a plane."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Explicit 4D Gaussians that any camera can look at, at any time."""

    gaussians: Gaussians
    motion: Motion
    path: CameraPath
    """The suggested camera path; looking along another one is always possible."""
    provenance: Provenance
    dilation_px2: float = DILATION_PX2
    """Variance, in square pixels, that renderers add to footprints unless settings name another;
    0 for one that is sharp as it is. It is the scene's, as sizes and opacities were made for it."""

    def __post_init__(self) -> None:
        if not 0 <= self.dilation_px2 < math.inf:
            raise ConfigError(
                "Scene.dilation_px2: expected a finite number of at least 0, "
                f"got {self.dilation_px2}"
            )

    def state_at(self, time_s: float) -> Gaussians:
        """The Gaussians at ``time_s`` seconds."""
        return self.motion.state_at(self.gaussians, time_s)

    def select(self, keep: Bool[Tensor, " n"]) -> "Scene":
        """The scene with only the Gaussians under a mask."""
        return replace(self, gaussians=self.gaussians.select(keep), motion=self.motion.select(keep))

    def to(self, target: torch.device | torch.dtype) -> "Scene":
        """Move or cast Gaussians and motion; the suggested path stays where it is."""
        return replace(self, gaussians=self.gaussians.to(target), motion=self.motion.to(target))
