"""The renderer's knobs: references against closed forms, errors that fall, defaults in use."""

import math
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction

import pytest
import torch

from diff4splat.error_time import render_knobs
from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.error_time.render_knobs import Arithmetic, Dilation, averaged_image
from diff4splat.error_time.scene_knobs import rmse
from diff4splat.error_time.sweep import sweep
from diff4splat.geometry.camera import pinhole
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians

SIGMA_PX = 0.3


@pytest.fixture(autouse=True)
def _few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few Gaussians and few pixels."""
    monkeypatch.setattr(render_knobs, "GAUSSIANS", 1500)
    monkeypatch.setattr(render_knobs, "EXACT_GAUSSIANS", 300)
    monkeypatch.setattr(render_knobs, "SIZE_PX", (48, 64))


def errors_of(knob: ApproximationSetting) -> list[float]:
    return [row.error for row in sweep(knob, 1).rows]


def speck(opacity: float = 0.2) -> Gaussians:
    """One white Gaussian of ``SIGMA_PX`` on the corner of the four middle pixels."""
    width = render_knobs.SIZE_PX[1]
    return Gaussians(
        means=torch.tensor([[0.0, 0.0, 2.0]]),
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]]),
        scales=torch.full((1, 3), SIGMA_PX * 2.0 / width),
        opacities=torch.tensor([opacity]),
        sh=torch.full((1, 1, 3), 0.5 * math.sqrt(4 * math.pi)),
    )


def mean_over_squares(size: int) -> torch.Tensor:
    """Of exp(-x² / 2σ²) over the pixels of a row whose middle is x = 0, in float64."""
    edges = torch.arange(size + 1, dtype=torch.float64) - size / 2
    whole = SIGMA_PX * math.sqrt(math.pi / 2)
    return whole * torch.erf(edges / (SIGMA_PX * math.sqrt(2))).diff()


def test_tiles_change_nothing() -> None:
    assert max(errors_of(render_knobs.tile_knob())) < 1e-5


def test_a_lower_support_cutoff_is_more_exact() -> None:
    errors = errors_of(render_knobs.support_knob())
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 0.05
    assert errors[-1] < 1e-3


def test_a_lower_light_cutoff_is_more_exact() -> None:
    errors = errors_of(render_knobs.light_knob())
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 1e-3
    assert errors[-1] < 1e-7


def test_the_image_that_never_stops_is_that_of_the_reference_renderer() -> None:
    knob = render_knobs.light_knob()
    height, width = render_knobs.SIZE_PX
    cloud = render_knobs.half_faint_gaussians(render_knobs.GAUSSIANS)
    made = render(cloud, pinhole(float(width), (height, width)), backend="reference").rgb
    assert rmse(knob.run(knob.reference), made) < 1e-4


def test_averaged_samples_are_the_integral_over_the_pixel() -> None:
    height, width = render_knobs.SIZE_PX
    expected = 0.2 * mean_over_squares(height)[:, None] * mean_over_squares(width)
    made = averaged_image(speck(), render_knobs.dilation_knob().reference)
    assert made.shape == (height, width, 3)
    for channel in made.double().unbind(-1):
        torch.testing.assert_close(channel, expected, atol=2e-5, rtol=0)


def test_the_average_has_enough_samples() -> None:
    cloud, knob = render_knobs.fine_gaussians(render_knobs.GAUSSIANS), render_knobs.dilation_knob()
    made = averaged_image(cloud, knob.reference)
    finer = averaged_image(cloud, replace(knob.reference, samples=2 * render_knobs.SAMPLES))
    assert rmse(made, finer) < 0.2 * min(errors_of(knob))


def test_dilation_adds_light_and_compensation_takes_it_back() -> None:
    exact = averaged_image(speck(), Dilation(variance_px2=0.0, samples=8)).sum()
    blurred = averaged_image(speck(), Dilation(variance_px2=0.3)).sum()
    kept = averaged_image(speck(), Dilation(variance_px2=0.3, compensated=True)).sum()
    more = (SIGMA_PX**2 + 0.3) / SIGMA_PX**2
    assert float(blurred / exact) == pytest.approx(more, rel=0.02)
    assert float(kept / exact) == pytest.approx(1, rel=0.02)


def test_the_best_blur_is_a_compensated_one() -> None:
    measured = sweep(render_knobs.dilation_knob(), 1)
    best = min(measured.rows, key=lambda row: row.error)
    assert best.setting.compensated
    assert best.error < 0.3 * measured.default.error
    assert {row.series for row in measured.rows} == {"none", "dilated", "compensated"}


def test_single_precision_is_nearly_double_precision() -> None:
    errors = errors_of(render_knobs.precision_knob())
    assert all(0 < error < 1e-4 for error in errors[:2])
    assert errors[2] == 0


def test_defaults_are_those_of_the_renderer() -> None:
    height, width = render_knobs.SIZE_PX
    cloud = render_knobs.half_faint_gaussians(render_knobs.GAUSSIANS)
    made = render(cloud, pinhole(float(width), (height, width)), backend="raster").rgb
    for build in (render_knobs.tile_knob, render_knobs.support_knob, render_knobs.light_knob):
        knob = build()
        assert torch.equal(knob.run(knob.default), made), knob.name
    settings, dilation = RenderSettings(), render_knobs.dilation_knob().default
    assert dilation.variance_px2 == settings.added_px2
    assert dilation.compensated == settings.antialias
    assert str(render_knobs.precision_knob().default) == "raster float32"


def test_the_scene_has_a_saturated_and_a_faint_half() -> None:
    height, width = render_knobs.SIZE_PX
    cloud = render_knobs.half_faint_gaussians(20_000)
    camera = pinhole(float(width), (height, width))
    alpha = render(cloud, camera, outputs=("alpha",)).alpha
    left, right = alpha[:, : width // 2 - 8], alpha[:, width // 2 + 8 :]
    assert float(left.median()) > 0.999
    assert float(cloud.opacities[cloud.means[:, 0] > 0].max()) <= 0.12
    assert float(right.mean()) < float(left.mean())


def test_settings_read_well() -> None:
    names = [str(setting) for setting in render_knobs.dilation_knob().settings]
    assert names[:3] == ["none", "dilated 0.0833 px²", "dilated 0.2 px²"]
    assert str(render_knobs.dilation_knob().reference) == "none, 8² samples"
    assert str(Arithmetic(backend="raster", dtype=torch.float32)) == "raster float32"
    assert str(render_knobs.support_knob().default) == str(Fraction(1, 255))


@pytest.mark.slow
def test_listing_knobs_loads_no_compiler() -> None:
    code = (
        "import sys\nfrom diff4splat.error_time.known_knobs import known_knobs\nknown_knobs()\n"
        "assert 'numba' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
