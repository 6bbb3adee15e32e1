"""Knobs of the renderer: what its speed costs, measured on a seeded scene.

Axes: ``n`` Gaussians, ``h w`` pixels. The left half of the scene is saturated: many layers, most of
them never seen. The right half is faint: haze whose parts are barely above the support cut-off. The
error is the root mean square difference of RGB values in [0, 1].

What counts as exact is the renderer with the one approximation switched off, except for dilation.
There it is the image that a sensor would see: pixels that average over their square, as the mean
of 8 × 8 samples without dilation. A pixel's square has a variance of 1/12 px² along both axes, so a
dilation of that size, with opacities that compensate for it, is what a blur can do at best.
"""

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.error_time.scene_knobs import random_gaussians, rmse, truncate_harmonics
from diff4splat.geometry.camera import pinhole
from diff4splat.render.api import render
from diff4splat.render.raster.raster_settings import (
    DEFAULT_LIGHT_CUTOFF,
    DEFAULT_TILE_PX,
    TILE_SIZES_PX,
)
from diff4splat.render.settings import LEAST_LIGHT, RenderSettings
from diff4splat.scene.gaussians import Gaussians

GAUSSIANS = 20_000
EXACT_GAUSSIANS = 4_000
"""As many as the reference back end draws in float64 within a tenth of a second."""
SIZE_PX = (240, 320)
SAMPLES = 8
"""Per pixel and axis, where an image is averaged."""
LEAST_CUTOFF = Fraction(1, 1_000_000)
_DEFAULTS = RenderSettings()
_DILATIONS_PX2 = (1 / 12, 0.2, 0.3)
_ERROR_UNIT = "RMSE of RGB in [0, 1]"


@dataclass(frozen=True, slots=True, kw_only=True)
class Dilation:
    """How footprints smaller than a pixel are kept from falling between pixel centres."""

    variance_px2: float
    compensated: bool = False
    samples: int = 1
    """Per pixel and axis; the image is their mean."""

    @property
    def kind(self) -> str:
        """What happens to the opacity."""
        if self.variance_px2 == 0:
            return "none"
        return "compensated" if self.compensated else "dilated"

    def __str__(self) -> str:
        amount = f" {self.variance_px2:.3g} px²" if self.variance_px2 else ""
        return f"{self.kind}{amount}" + (f", {self.samples}² samples" if self.samples > 1 else "")


@dataclass(frozen=True, slots=True, kw_only=True)
class Arithmetic:
    """A back end and the floating-point numbers it computes with."""

    backend: str
    dtype: torch.dtype

    def __str__(self) -> str:
        return f"{self.backend} {str(self.dtype).removeprefix('torch.')}"


def tile_knob() -> ApproximationSetting:
    """How many pixels share one list of Gaussians."""
    return ApproximationSetting(
        name="tile-size",
        fields=("RenderSettings.tile_px",),
        summary="cutting the image into tiles, which should change nothing",
        error_unit=_ERROR_UNIT,
        settings=TILE_SIZES_PX,
        default=DEFAULT_TILE_PX,
        reference=min(TILE_SIZES_PX),
        run=lambda tile_px: _half_faint(replace(_DEFAULTS, tile_px=tile_px)),
        error=rmse,
        label_meaning="edge of a tile in pixels",
    )


def support_knob() -> ApproximationSetting:
    """Below which contribution to a pixel a Gaussian ends."""
    denominators = (16, 64, 128, 255, 512, 1024, 10_000)
    return ApproximationSetting(
        name="support-cutoff",
        fields=("RenderSettings.alpha_cutoff",),
        summary="cutting off Gaussians where they contribute little",
        error_unit=_ERROR_UNIT,
        settings=tuple(Fraction(1, number) for number in denominators),
        default=Fraction(_DEFAULTS.alpha_cutoff).limit_denominator(max(denominators)),
        reference=LEAST_CUTOFF,
        run=lambda cutoff: _half_faint(replace(_DEFAULTS, alpha_cutoff=float(cutoff))),
        error=rmse,
        label_meaning="smallest contribution",
    )


def light_knob() -> ApproximationSetting:
    """When a pixel has seen enough layers."""
    return ApproximationSetting(
        name="light-cutoff",
        fields=("RenderSettings.light_cutoff",),
        summary="stopping where little light comes through from behind",
        error_unit=_ERROR_UNIT,
        settings=tuple(10.0**-power for power in (1, 2, 3, 4, 5, 6, 7, 9)),
        default=DEFAULT_LIGHT_CUTOFF,
        reference=LEAST_LIGHT,
        run=lambda cutoff: _half_faint(replace(_DEFAULTS, light_cutoff=cutoff)),
        error=rmse,
        label=lambda cutoff: f"{cutoff:g}",
        label_meaning="light at which to stop",
    )


def dilation_knob() -> ApproximationSetting:
    """What stands in for the average over a pixel's square."""
    settings = tuple(
        Dilation(variance_px2=variance, compensated=compensated)
        for compensated in (False, True)
        for variance in _DILATIONS_PX2
    )
    return ApproximationSetting(
        name="dilation",
        fields=("RenderSettings.dilation_px2", "RenderSettings.antialias"),
        summary="blurring footprints instead of averaging over pixels",
        error_unit=_ERROR_UNIT,
        settings=(Dilation(variance_px2=0.0), *settings),
        default=Dilation(variance_px2=_DEFAULTS.added_px2, compensated=_DEFAULTS.antialias),
        reference=Dilation(variance_px2=0.0, samples=SAMPLES),
        run=lambda dilation: averaged_image(fine_gaussians(GAUSSIANS), dilation),
        error=rmse,
        series=lambda dilation: dilation.kind,
        label=lambda dilation: f"{dilation.variance_px2:.3g}",
        label_meaning="variance added, px²",
    )


def precision_knob() -> ApproximationSetting:
    """Which back end, in which floating-point numbers."""
    kinds = (("raster", torch.float32), ("reference", torch.float32), ("reference", torch.float64))
    settings = tuple(Arithmetic(backend=backend, dtype=dtype) for backend, dtype in kinds)
    return ApproximationSetting(
        name="precision",
        summary="drawing in single precision, with kernels or PyTorch",
        error_unit=_ERROR_UNIT,
        settings=settings,
        default=settings[0],
        reference=settings[-1],
        run=_computed_image,
        error=rmse,
    )


@cache
def half_faint_gaussians(count: int) -> Gaussians:
    """Saturated on the left, haze on the right; one colour each."""
    cloud = truncate_harmonics(random_gaussians(seed=1, count=count), 0)
    haze = 0.02 + 0.1 * cloud.opacities
    left = cloud.means[:, 0] < 0
    return replace(cloud, opacities=torch.where(left, cloud.opacities.sqrt(), haze))


@cache
def fine_gaussians(count: int) -> Gaussians:
    """The same scene with footprints from far below a pixel to several pixels."""
    cloud = half_faint_gaussians(count)
    shrink = torch.rand(count, 1, generator=torch.Generator().manual_seed(2)) * -3.5
    return replace(cloud, scales=cloud.scales * shrink.exp())


def averaged_image(gaussians: Gaussians, dilation: Dilation) -> Float[Tensor, "h w 3"]:
    """The mean of the samples of each pixel; every contribution counts, so that only these blur."""
    count = dilation.samples
    settings = RenderSettings(
        dilation_px2=dilation.variance_px2,
        antialias=dilation.compensated,
        alpha_cutoff=float(LEAST_CUTOFF),
    )
    rgb = _image(gaussians, settings, samples=count)
    return rgb.unflatten(1, (-1, count)).unflatten(0, (-1, count)).mean((1, 3))


def _computed_image(arithmetic: Arithmetic) -> Float[Tensor, "h w 3"]:
    """Where pixels never stop looking: what the reference back end does in any case."""
    cloud = half_faint_gaussians(EXACT_GAUSSIANS).to(arithmetic.dtype)
    settings = replace(_DEFAULTS, light_cutoff=LEAST_LIGHT)
    return _image(cloud, settings, backend=arithmetic.backend).double()


def _half_faint(settings: RenderSettings) -> Float[Tensor, "h w 3"]:
    return _image(half_faint_gaussians(GAUSSIANS), settings)


def _image(
    gaussians: Gaussians, settings: RenderSettings, samples: int = 1, backend: str = "raster"
) -> Float[Tensor, "h w 3"]:
    height, width = (side * samples for side in SIZE_PX)
    camera = pinhole(float(width), (height, width))
    return render(gaussians, camera, settings=settings, backend=backend).rgb
