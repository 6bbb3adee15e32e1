"""What both tracers look at: a cloud in front of a pinhole, its footprints a few pixels wide.

Lengths are tens of units: Mitsuba goes on 1e-4 behind an entry, and its entries on ellipsoids much
smaller than a unit are wrong by more than that, so that it would meet most of them twice.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.rays import world_rays
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians

RULES = TraceSettings(
    alpha_cutoff=1e-9, alpha_max=0.9999, light_cutoff=0.01, min_response=0.011108996538242306
)
"""Mitsuba's: everything inside of three standard deviations, until a hundredth of the light."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """One row of the table."""

    count: int
    edge_px: int = 256
    sigma_px: tuple[float, float] = (1.0, 2.0)

    @property
    def name(self) -> str:
        return f"{self.count:,} at {self.edge_px}²"

    def build(self) -> tuple[Gaussians, Rays]:
        """Float32 and one ray through the centre of every pixel; equal on every call."""
        generator = torch.Generator().manual_seed(self.count)

        def uniform(*shape: int, low: float = 0.0, high: float = 1.0) -> Tensor:
            return low + (high - low) * torch.rand(self.count, *shape, generator=generator)

        depth = uniform(1, low=50.0, high=250.0)
        size = uniform(1, low=self.sigma_px[0], high=self.sigma_px[1]) * depth / self.edge_px
        gaussians = Gaussians(
            means=torch.cat([uniform(2, low=-0.5, high=0.5) * depth, depth], 1),
            quats=torch.randn(self.count, 4, generator=generator),
            scales=size * uniform(3, low=-0.3, high=0.3).exp(),
            opacities=uniform(low=0.1, high=0.9),
            sh=uniform(1, 3, low=-0.5, high=0.9),
        )
        camera = pinhole(float(self.edge_px), (self.edge_px, self.edge_px))
        origins, directions = (part.flatten(0, 1) for part in world_rays(camera))
        return gaussians, Rays(origins=origins, directions=directions)


SCENES = (Scene(count=20_000), Scene(count=65_536))
