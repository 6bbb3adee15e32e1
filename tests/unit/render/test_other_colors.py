"""One view drawn in other colours."""

import math
from dataclasses import replace

import pytest
import torch
from jaxtyping import Float
from oracles_raster import cloud, wide_camera
from torch import Tensor

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.render.api import render
from diff4splat.render.other_colors import open_view
from diff4splat.render.raster import fixed_view, forward
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians

CAMERA = wide_camera((40, 50))
BEHIND = RenderSettings(background=(0.2, 0.4, 0.6), dilation_px2=0.0)


def other_colors(gaussians: Gaussians, seed: int = 1) -> Float[Tensor, "n k 3"]:
    return torch.randn(gaussians.sh.shape, generator=torch.Generator().manual_seed(seed))


def rendered(gaussians: Gaussians, sh: Tensor, backend: str = "raster") -> Tensor:
    recolored = replace(gaussians, sh=sh)
    return render(recolored, CAMERA, settings=BEHIND, backend=backend).rgb


@pytest.mark.parametrize("backend", ["raster", "reference"])
@pytest.mark.parametrize("bands", [1, 4])
def test_every_image_is_that_of_render(backend: str, bands: int) -> None:
    gaussians = cloud(200, bands=bands)
    draw = open_view(gaussians, CAMERA, settings=BEHIND, backend=backend)
    for sh in (gaussians.sh, other_colors(gaussians), gaussians.sh):
        assert torch.equal(draw(sh), rendered(gaussians, sh, backend))


def test_lists_that_do_not_fit_are_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fixed_view, "BYTES_PER_PAIR", BEHIND.memory_bytes // 50)
    gaussians, regions = cloud(200), []
    fill = forward.fill_region
    monkeypatch.setattr(
        forward, "fill_region", lambda *args: regions.append(args[-1]) or fill(*args)
    )
    draw = open_view(gaussians, CAMERA, settings=BEHIND, backend="raster")
    assert not regions
    for sh in (gaussians.sh, other_colors(gaussians)):
        assert torch.equal(draw(sh), rendered(gaussians, sh))
    assert len(set(regions)) > 2


def test_lists_that_fit_are_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    gaussians, filled = cloud(200), []
    fill = forward.fill_region
    monkeypatch.setattr(
        forward, "fill_region", lambda *args: filled.append(args[-1]) or fill(*args)
    )
    draw = open_view(gaussians, CAMERA, settings=BEHIND, backend="raster")
    draw(gaussians.sh), draw(other_colors(gaussians))
    assert len(filled) == 1


@pytest.mark.parametrize("at_first", [True, False])
def test_gaussians_without_finite_colors_are_left_out(at_first: bool) -> None:
    gaussians = cloud(200)
    broken = gaussians.sh.clone()
    broken[:50] = math.nan
    first = replace(gaussians, sh=broken) if at_first else gaussians
    draw = open_view(first, CAMERA, settings=BEHIND, backend="raster")
    for sh in (broken, gaussians.sh):
        assert torch.equal(draw(sh), rendered(gaussians, sh))
        assert bool(torch.isfinite(draw(sh)).all())


def test_nothing_is_background() -> None:
    image = open_view(cloud(0), CAMERA, settings=BEHIND)(cloud(0).sh)
    assert torch.equal(image, torch.tensor(BEHIND.background).expand(40, 50, 3))


@pytest.mark.parametrize("backend", ["raster", "reference"])
def test_it_has_no_gradient(backend: str) -> None:
    gaussians = cloud(20)
    draw = open_view(gaussians, CAMERA, backend=backend)
    assert not draw(gaussians.sh.requires_grad_()).requires_grad


def test_mistakes_are_named() -> None:
    gaussians = cloud(20)
    with pytest.raises(
        ShapeError, match=r"sh: expected \(20, 1, 3\) as at first, got \(19, 1, 3\)"
    ):
        open_view(gaussians, CAMERA)(gaussians.sh[1:])
    with pytest.raises(ConfigError, match="backend: expected auto"):
        open_view(gaussians, CAMERA, backend="none")
