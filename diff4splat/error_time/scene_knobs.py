"""Knobs of the scene itself, measured on a seeded random scene.

Axes: ``n`` Gaussians, ``h w`` pixels. The scene is a cloud in front of one camera whose opacities
crowd towards 0, as those of pixel-aligned heads do. The error is the root mean square difference
of RGB values in [0, 1] from the image of the untouched scene.
"""

from dataclasses import replace
from functools import cache

import torch
from torch import Tensor

from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.scene.edit import MIN_OPACITY
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import BAND_SIZES

GAUSSIANS = 12_000
SIZE_PX = (144, 192)
_ERROR_UNIT = "RMSE of RGB in [0, 1]"


def pruning_knob() -> ApproximationSetting:
    """Which Gaussians are too transparent to keep."""
    return ApproximationSetting(
        name="pruning",
        summary="dropping Gaussians below an opacity",
        error_unit=_ERROR_UNIT,
        settings=(0.0, MIN_OPACITY, 0.01, 0.02, 0.05, 0.1, 0.2),
        default=MIN_OPACITY,
        reference=0.0,
        run=lambda min_opacity: image(prune_gaussians(random_gaussians(), min_opacity)),
        error=rmse,
        label=lambda min_opacity: f"{min_opacity:g}",
        label_meaning="smallest opacity kept",
    )


def harmonics_knob() -> ApproximationSetting:
    """How many bands of view-dependent colour to evaluate."""
    return ApproximationSetting(
        name="sh-degree",
        summary="leaving out the upper bands of the spherical harmonics",
        error_unit=_ERROR_UNIT,
        settings=tuple(range(len(BAND_SIZES))),
        default=len(BAND_SIZES) - 1,
        reference=len(BAND_SIZES) - 1,
        run=lambda degree: image(truncate_harmonics(random_gaussians(), degree)),
        error=rmse,
        label_meaning="highest degree",
    )


@cache
def random_gaussians(seed: int = 0, count: int = GAUSSIANS) -> Gaussians:
    """A cloud at depths of 2 to 6, most of it nearly transparent, with degree-3 colour."""
    generator = torch.Generator().manual_seed(seed)

    def uniform(*shape: int) -> Tensor:
        return torch.rand(count, *shape, generator=generator)

    depth = 2 + 4 * uniform(1)
    sideways = (uniform(2) - 0.5) * depth * torch.tensor([1.0, 0.75])
    fade = torch.tensor([1.0, *[0.3] * 3, *[0.15] * 5, *[0.08] * 7])
    return Gaussians(
        means=torch.cat([sideways, depth], 1),
        quats=torch.nn.functional.normalize(uniform(4) - 0.5, dim=-1),
        scales=0.01 + 0.08 * uniform(3),
        opacities=uniform() ** 4,
        sh=(3 * uniform(16, 3) - 1.5) * fade[:, None],
    )


def prune_gaussians(gaussians: Gaussians, min_opacity: float) -> Gaussians:
    """Those of at least ``min_opacity``."""
    return gaussians.select(gaussians.opacities >= min_opacity)


def truncate_harmonics(gaussians: Gaussians, degree: int) -> Gaussians:
    """Colour up to ``degree`` only."""
    return replace(gaussians, sh=gaussians.sh[:, : BAND_SIZES[degree]])


def image(gaussians: Gaussians) -> Tensor:
    """RGB ``h w 3`` of the knobs' camera."""
    from diff4splat.render.api import render

    return render(gaussians, _camera(), 0.0, outputs=("rgb",)).rgb


def rmse(result: Tensor, reference: Tensor) -> float:
    """Root mean square difference."""
    return float((result - reference).square().mean().sqrt())


def _camera() -> Camera:
    return pinhole(float(SIZE_PX[1]), SIZE_PX)
