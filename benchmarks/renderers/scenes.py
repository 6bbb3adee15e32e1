"""The scenes that every renderer draws: seeded, described once, built where they are needed.

Axes: ``n`` Gaussians. The camera stands at the origin, looks along z, and its focal length is the
width of the image, so that x / z spans -0.5 to 0.5. A footprint's radius is 3 det(C)^(1/4) with C
its covariance in pixels, the dilation of 0.3 px² included: three standard deviations of the circle
of equal area. Degree-0 colour is uniform in [0, 1]; higher bands are small.
"""

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.geometry.depth import unproject
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import BAND_SIZES, dc_from_color

DILATION_PX2 = 0.3
Make = Callable[[Camera, int, torch.Generator], Gaussians]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """One row of the comparison; cheap to send to another process, because it is not built yet."""

    name: str
    count: int
    size_px: tuple[int, int]
    """(height, width)"""
    make: Make
    degree: int = 0

    def build(self) -> tuple[Gaussians, Camera]:
        """The Gaussians, float32, and the camera; equal bits on every call."""
        camera = pinhole(float(self.size_px[1]), self.size_px)
        generator = torch.Generator().manual_seed(zlib.crc32(self.name.encode()))
        return self.make(camera, self.count, generator), camera


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """Ranges that the Gaussians of a cloud are drawn from, uniformly."""

    radius_px: tuple[float, float] = (3.0, 6.0)
    opacity: tuple[float, float] = (0.1, 0.9)
    degree: int = 0


def cloud(look: Look, camera: Camera, count: int, generator: torch.Generator) -> Gaussians:
    """Nearly isotropic Gaussians that fill the frustum between depth 1 and 5."""

    def uniform(*shape: int, low: float = 0.0, high: float = 1.0) -> Tensor:
        return low + (high - low) * torch.rand(count, *shape, generator=generator)

    height, width = camera.size_px
    depth = uniform(1, low=1.0, high=5.0)
    tangent = uniform(2, low=-0.5, high=0.5) * torch.tensor([1.0, height / width])
    sigma_px = (uniform(1, low=look.radius_px[0], high=look.radius_px[1]) / 3).square()
    sigma_px = (sigma_px - DILATION_PX2).sqrt()
    # Off the axis a sphere's footprint is stretched by sqrt(1 + tan²) in one direction.
    stretch = (1 + tangent.square().sum(-1, keepdim=True)) ** 0.25
    uneven = torch.rand(count, 3, generator=generator).mul(0.2).sub(0.1).exp()
    return Gaussians(
        means=torch.cat([tangent * depth, depth], 1),
        quats=torch.randn(count, 4, generator=generator),
        scales=sigma_px / stretch * depth / camera.focal_px[0] * uneven,
        opacities=uniform(low=look.opacity[0], high=look.opacity[1]),
        sh=_harmonics(count, look.degree, generator),
    )


def aligned(camera: Camera, count: int, generator: torch.Generator) -> Gaussians:
    """One Gaussian per pixel on a smooth depth map, as a pixel-aligned network emits them."""
    knots = 4 + torch.rand(1, 1, 8, 8, generator=generator)
    depth = torch.nn.functional.interpolate(knots, camera.size_px, mode="bicubic")[0, 0]
    return Gaussians(
        means=unproject(camera, depth).flatten(0, 1),
        quats=torch.tensor([1.0, 0.0, 0.0, 0.0]).repeat(count, 1),
        scales=(0.6 * depth / camera.focal_px[0]).flatten()[:, None].repeat(1, 3),
        opacities=0.5 + 0.49 * torch.rand(count, generator=generator),
        sh=_harmonics(count, 0, generator),
    )


def huge(camera: Camera, count: int, generator: torch.Generator) -> Gaussians:
    """Gaussians that each cover the whole image: a standard deviation of its width."""
    depth = 2.0
    return Gaussians(
        means=torch.tensor([0.1, -0.1, depth]).repeat(count, 1),
        quats=torch.randn(count, 4, generator=generator),
        scales=torch.tensor([1.0, 0.8, 0.9]).repeat(count, 1) * depth,
        opacities=torch.full((count,), 0.9),
        sh=_harmonics(count, 0, generator),
    )


def coincident(camera: Camera, count: int, generator: torch.Generator) -> Gaussians:
    """Many Gaussians at one place, of one shape: every tile list is as long as the scene."""
    one = cloud(Look(radius_px=(12.0, 12.0)), camera, 1, generator)
    return Gaussians(
        means=torch.tensor([0.05, -0.03, 2.0]).repeat(count, 1),
        quats=one.quats.repeat(count, 1),
        scales=(one.scales / one.means[:, 2:] * 2.0).repeat(count, 1),
        opacities=0.1 + 0.8 * torch.rand(count, generator=generator),
        sh=_harmonics(count, 0, generator),
    )


def _harmonics(count: int, degree: int, generator: torch.Generator) -> Float[Tensor, "n k 3"]:
    base = dc_from_color(torch.rand(count, 1, 3, generator=generator))
    bands = 0.1 * torch.randn(count, BAND_SIZES[degree] - 1, 3, generator=generator)
    return torch.cat([base, bands], 1)


def _all() -> dict[str, Scene]:
    sizes = {"256": (256, 256), "512": (512, 512), "720p": (720, 1280)}
    counts = {"10k": 10_000, "100k": 100_000, "500k": 500_000}
    plain, faint = partial(cloud, Look()), Look(radius_px=(30.0, 60.0), opacity=(0.01, 0.05))
    made = [
        Scene(name=f"cloud-{many}-{size}", count=count, size_px=sizes[size], make=plain)
        for many, count in counts.items()
        for size in sizes
    ]
    made += [
        Scene(name=f"aligned-{side}", count=side * side, size_px=(side, side), make=aligned)
        for side in (256, 512)
    ]
    square, bands = (512, 512), partial(cloud, Look(degree=3))
    made += [
        Scene(name="huge-512", count=1, size_px=square, make=huge),
        Scene(name="coincident-100k-256", count=100_000, size_px=(256, 256), make=coincident),
        Scene(name="overdraw-50k-512", count=50_000, size_px=square, make=partial(cloud, faint)),
        Scene(name="sh3-100k-512", count=100_000, size_px=square, make=bands, degree=3),
    ]
    return {scene.name: scene for scene in made}


SCENES = _all()
TINY = {
    degree: Scene(
        name="tiny",
        count=50,
        size_px=(32, 32),
        make=partial(cloud, Look(degree=degree)),
        degree=degree,
    )
    for degree in range(len(BAND_SIZES))
}
"""What compiles and warms a renderer up before anything is timed, per degree of the harmonics."""


def choose(patterns: Sequence[str]) -> list[Scene]:
    """Scenes whose names match any of ``patterns`` (``cloud-*``), in the order of the list.

    Raises:
        ConfigError: a pattern matches nothing.
    """
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in SCENES):
            raise ConfigError(f"--scenes: expected names among {', '.join(SCENES)}, got {pattern}")
    return [
        scene
        for name, scene in SCENES.items()
        if any(fnmatchcase(name, pattern) for pattern in patterns)
    ]
