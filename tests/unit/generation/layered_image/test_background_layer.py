"""The layer behind the pixels of one picture."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from diff4splat.generation.layered_image.background_layer import (
    AROUND,
    BEHIND,
    FOOTPRINT_PX,
    BackgroundLayer,
    background_layer,
)
from diff4splat.geometry.camera import Camera, project
from diff4splat.render.api import render
from diff4splat.scene.harmonics import color_from_dc

SIDE = 16
FOCAL_PX = 20.0


def camera(side: int = SIDE) -> Camera:
    return Camera(
        focal_px=torch.full((2,), FOCAL_PX),
        center_px=torch.full((2,), side / 2),
        world_from_camera=torch.eye(4),
        size_px=(side, side),
    )


def colors(layer: BackgroundLayer) -> torch.Tensor:
    return color_from_dc(layer.gaussians.sh[:, 0]).view(SIDE, SIDE, 3)


def halves() -> tuple[torch.Tensor, torch.Tensor]:
    """Red and near on the left, blue and far on the right."""
    depth = torch.full((SIDE, SIDE), 8.0)
    depth[:, : SIDE // 2] = 2.0
    rgb = torch.zeros(SIDE, SIDE, 3)
    rgb[..., 2] = 1.0
    rgb[:, : SIDE // 2] = torch.tensor([1.0, 0.0, 0.0])
    return rgb, depth


def test_on_one_surface_it_has_the_pixels_colours_behind_them() -> None:
    rgb, depth = torch.rand(SIDE, SIDE, 3), torch.full((SIDE, SIDE), 3.0)
    layer = background_layer(rgb, depth, camera())
    torch.testing.assert_close(colors(layer), rgb, atol=1e-6, rtol=0)
    pixels, z = project(camera(), layer.gaussians.means)
    torch.testing.assert_close(z, torch.full_like(z, 3.0 * BEHIND))
    rows, columns = torch.meshgrid(torch.arange(SIDE), torch.arange(SIDE), indexing="ij")
    centers = torch.stack([columns, rows], -1).flatten(0, 1) + 0.5
    torch.testing.assert_close(pixels, centers, atol=1e-4, rtol=0)
    assert layer.cells.tolist() == list(range(SIDE * SIDE))
    width = FOOTPRINT_PX * 3.0 * BEHIND / FOCAL_PX
    torch.testing.assert_close(
        layer.gaussians.scales, torch.full_like(layer.gaussians.scales, width)
    )


def test_before_an_edge_it_belongs_to_what_lies_behind_and_stands() -> None:
    rgb, depth = halves()
    layer = background_layer(rgb, depth, camera())
    edge, reach = SIDE // 2, AROUND // 2
    z = project(camera(), layer.gaussians.means)[1].view(SIDE, SIDE)
    near, far = z[:, : edge - reach], z[:, edge - reach :]
    torch.testing.assert_close(near, torch.full_like(near, 2.0 * BEHIND))
    torch.testing.assert_close(far, torch.full_like(far, 8.0 * BEHIND))
    blue = torch.tensor([0.0, 0.0, 1.0]).expand(SIDE, SIDE - edge + reach, 3)
    torch.testing.assert_close(colors(layer)[:, edge - reach :], blue, atol=1e-6, rtol=0)
    stands = layer.cells.view(SIDE, SIDE) == SIDE * SIDE
    assert stands[:, edge - reach : edge].all()
    assert not stands[:, : edge - reach].any() and not stands[:, edge:].any()


def test_nothing_of_it_stands_before_a_pixel_near_it() -> None:
    generator = torch.Generator().manual_seed(0)
    depth = torch.rand(SIDE, SIDE, generator=generator) * 20 + 1
    layer = background_layer(torch.rand(SIDE, SIDE, 3), depth, camera())
    z = project(camera(), layer.gaussians.means)[1].view(1, SIDE, SIDE)
    farthest = torch.nn.functional.max_pool2d(depth[None], AROUND, 1, AROUND // 2)
    assert bool((z > farthest).all())


def test_a_slanted_floor_is_one_surface() -> None:
    rows = torch.arange(SIDE) + 0.5
    depth = (20 / (rows + 30)).view(-1, 1).expand(SIDE, SIDE).contiguous()
    layer = background_layer(torch.rand(SIDE, SIDE, 3), depth, camera())
    assert layer.cells.tolist() == list(range(SIDE * SIDE))


@given(st.sampled_from((1e-3, 1.0, 1e4)), st.integers(0, 5), st.integers(1, 9))
def test_any_depth_and_size_is_finite(unit: float, seed: int, side: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    depth = unit * (0.01 + 100 * torch.rand(side, side, generator=generator))
    layer = background_layer(torch.rand(side, side, 3), depth, camera(side))
    for value in (layer.gaussians.means, layer.gaussians.scales, layer.gaussians.sh):
        assert bool(value.isfinite().all())
    assert bool((layer.gaussians.scales > 0).all())


def test_it_shows_no_black_where_small_pixels_part() -> None:
    rgb, depth = torch.full((SIDE, SIDE, 3), 0.8), torch.full((SIDE, SIDE), 4.0)
    seen = render(background_layer(rgb, depth, camera()).gaussians, camera()).rgb
    inner = seen[3:-3, 3:-3]
    torch.testing.assert_close(inner, torch.full_like(inner, 0.8), atol=0.01, rtol=0)


def test_no_gradient_passes() -> None:
    rgb, depth = halves()
    layer = background_layer(rgb.requires_grad_(), depth.requires_grad_(), camera())
    assert not layer.gaussians.means.requires_grad
    assert not layer.gaussians.sh.requires_grad


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_precision_is_that_of_the_depth(dtype: torch.dtype) -> None:
    rgb, depth = (part.to(dtype) for part in halves())
    layer = background_layer(rgb, depth, camera().to(dtype))
    assert layer.gaussians.means.dtype == dtype
    assert math.isfinite(float(layer.gaussians.means.sum()))
