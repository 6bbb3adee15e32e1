"""The layer beyond the border: its grid, its colours, and that it hides nothing of the image."""

import math
from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from image_layers import (
    FAR_RANGES,
    FOCAL_PX,
    input_image,
    is_finite,
    layer,
    layered,
    random_depth,
    random_rgb,
)
from torch import Tensor

from diff4splat.generation.layered_image.border.extension import (
    BEHIND,
    FOOTPRINT_CELLS,
    OPACITY,
    REACH_SIGMAS,
    border_extension,
    extended_camera,
    farthest_covered,
    push_behind_surface,
    push_farther_than_rings,
)
from diff4splat.generation.layered_image.build import build_layered_image
from diff4splat.generation.layered_image.gaussians import image_gaussians, layer_gaussians
from diff4splat.generation.layered_image.obliqueness import is_drawable
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.geometry.camera import focal_from_fov, pinhole, project
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.geometry.rays import camera_rays
from diff4splat.models.blocks.conv_block import CELL_PX
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings

SIZE_PX, MARGIN = (16, 24), 3
GRID = (4 + 2 * MARGIN, 6 + 2 * MARGIN)
TAILS = 4 * OPACITY * math.exp(-(REACH_SIGMAS**2) / 2)
"""What a few footprints may still show beyond their reach."""


def extension(rgb: Tensor, depth: Tensor, margin: int = MARGIN) -> ImageLayer:
    camera = input_image(rgb).camera
    return push_behind_surface(border_extension(rgb, depth, camera, margin), depth, margin)


def test_a_cell_has_the_mean_colour_and_distance_of_its_pixels() -> None:
    rgb, depth = random_rgb(*SIZE_PX), random_depth(*SIZE_PX, (3.0, 3.1))
    camera = input_image(rgb).camera
    cells = border_extension(rgb, depth, camera, MARGIN)
    distance = distance_from_depth(camera, depth)
    assert cells.camera.size_px == GRID and bool(cells.mask.all())
    rays = camera_rays(cells.camera).norm(dim=-1)
    for row in range(4):
        for column in range(6):
            block = (slice(4 * row, 4 * row + 4), slice(4 * column, 4 * column + 4))
            own = (row + MARGIN, column + MARGIN)
            torch.testing.assert_close(cells.rgb[own], rgb[block].mean((0, 1)))
            wanted = BEHIND * distance[block].mean() / rays[own]
            torch.testing.assert_close(cells.depth[own], wanted)


def test_beyond_the_border_the_distance_of_the_nearest_cell_continues() -> None:
    rgb, depth = random_rgb(*SIZE_PX), random_depth(*SIZE_PX, (3.0, 30.0))
    cells = border_extension(rgb, depth, input_image(rgb).camera, MARGIN)
    distance = cells.depth * camera_rays(cells.camera).norm(dim=-1)
    for row in range(GRID[0]):
        for column in range(GRID[1]):
            inner = (min(max(row, MARGIN), 3 + MARGIN), min(max(column, MARGIN), 5 + MARGIN))
            torch.testing.assert_close(distance[row, column], distance[inner])


def test_its_camera_extends_the_view_by_whole_cells() -> None:
    camera = pinhole(FOCAL_PX, SIZE_PX)
    points = torch.randn(20, 3) + torch.tensor([0.0, 0.0, 5.0])
    pixels, cells = (project(each, points)[0] for each in (camera, extended_camera(camera, MARGIN)))
    torch.testing.assert_close(cells, pixels / CELL_PX + MARGIN, atol=1e-4, rtol=1e-5)


def test_cells_are_nearly_opaque_and_meet() -> None:
    gaussians = layer_gaussians(extension(random_rgb(*SIZE_PX), torch.full(SIZE_PX, 4.0)))
    torch.testing.assert_close(gaussians.opacities, torch.full_like(gaussians.opacities, OPACITY))
    z = gaussians.means[:, 2]
    footprint = FOOTPRINT_CELLS * CELL_PX * z / FOCAL_PX
    torch.testing.assert_close(gaussians.scales, footprint[:, None].expand(-1, 3))


def test_the_farthest_pixel_under_a_footprint_decides() -> None:
    depth = random_depth(*SIZE_PX, (1.0, 30.0))
    farthest = farthest_covered(depth, MARGIN)
    reach_px = REACH_SIGMAS * FOOTPRINT_CELLS * CELL_PX
    rows, columns = torch.meshgrid(*(torch.arange(side) + 0.5 for side in SIZE_PX), indexing="ij")
    for row in range(GRID[0]):
        for column in range(GRID[1]):
            y, x = CELL_PX * (row - MARGIN + 0.5), CELL_PX * (column - MARGIN + 0.5)
            covered = ((rows - y).abs() <= reach_px) & ((columns - x).abs() <= reach_px)
            if bool(covered.any()):
                assert float(farthest[row, column]) >= float(depth[covered].max())
            wide = ((rows - y).abs() <= reach_px + 2) & ((columns - x).abs() <= reach_px + 2)
            highest = float(depth[wide].max()) if bool(wide.any()) else 0.0
            assert float(farthest[row, column]) <= highest


def test_cells_move_back_only() -> None:
    rgb, depth = random_rgb(*SIZE_PX), random_depth(*SIZE_PX, (1.0, 30.0))
    before = border_extension(rgb, depth, input_image(rgb).camera, MARGIN)
    after = push_behind_surface(before, depth, MARGIN)
    assert bool((after.depth >= before.depth).all()) and not torch.equal(after.depth, before.depth)
    assert torch.equal(after.rgb, before.rgb)


def test_behind_rings_cells_keep_the_depth_of_the_border() -> None:
    """At one distance they would lie before it, more so the farther off the axis."""
    wide, depth = (64, 64), torch.full((64, 64), 4.0)
    before = border_extension(random_rgb(*wide), depth, pinhole(32.0, wide), 12)
    after = push_farther_than_rings(before, 12, 1 / 4)
    row, covered = 12 + 8, 4 + 1
    assert float(before.depth[row, 12 - covered]) < 0.8 * float(before.depth[row, 12])
    torch.testing.assert_close(
        after.depth[row, 12 - covered : 12], after.depth[row, 12].expand(covered)
    )
    far = slice(0, 12 - covered)
    assert torch.equal(after.depth[:, far], before.depth[:, far])
    assert torch.equal(after.depth[12:-12, 12:-12], before.depth[12:-12, 12:-12])
    assert bool((after.depth >= before.depth).all()) and torch.equal(after.rgb, before.rgb)


def change_of_input_view(hidden: ImageLayer, rgb: Tensor, depth: Tensor) -> float:
    """How much a layer changes any pixel of the rendered image."""
    shown = layer(depth, rgb=rgb, opacity=0.999, footprint_px=0.25, in_image=True)
    both = image_gaussians(layered(shown, hidden), torch.zeros(1)).gaussians
    camera, undilated = shown.camera, RenderSettings(dilation_px2=0.0)
    views = [
        render(gaussians, camera, settings=undilated).rgb
        for gaussians in (both, both.select(slice(depth.numel())))
    ]
    return float((views[0] - views[1]).abs().max())


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([1.0, 1.1, 3.0, 1e3]), st.integers(0, MARGIN))
def test_from_the_input_camera_it_hides_nothing(seed: int, contrast: float, margin: int) -> None:
    rgb, depth = random_rgb(*SIZE_PX, seed), random_depth(*SIZE_PX, (2.0, 2.0 * contrast), seed + 1)
    assert change_of_input_view(extension(rgb, depth, margin), rgb, depth) < TAILS


def test_where_it_lies_it_would_hide_the_image() -> None:
    rgb, depth = random_rgb(*SIZE_PX), random_depth(*SIZE_PX, (2.0, 60.0))
    before = border_extension(rgb, depth, input_image(rgb).camera, MARGIN)
    assert change_of_input_view(before, rgb, depth) > 2 * TAILS


@pytest.mark.parametrize("limits", FAR_RANGES)
@pytest.mark.parametrize("size", [SIZE_PX, (4, 4), (4, 32)])
def test_any_depth_and_size_is_finite(limits: tuple[float, float], size: tuple[int, int]) -> None:
    cells = extension(random_rgb(*size), random_depth(*size, limits))
    assert is_finite(cells)
    assert bool(layer_gaussians(cells).means.isfinite().all())


@pytest.mark.parametrize("fov_deg, least_db", [(60.0, 40.0), (150.0, 25.0), (170.0, 20.0)])
def test_extended_layers_of_a_wide_lens_do_not_hide_the_image(
    fov_deg: float, least_db: float
) -> None:
    size_px = (48, 48)
    camera = pinhole(focal_from_fov(fov_deg, size_px[1]), size_px)
    y, x = torch.meshgrid(*(torch.linspace(0, 1, side) for side in size_px), indexing="ij")
    rgb = torch.stack([x, y, 1 - x], -1)
    image = replace(input_image(rgb), camera=camera)
    # The same distance everywhere, so that depth falls towards the border.
    depth = 4 / camera_rays(camera).norm(dim=-1)
    maps = ImageMaps(depth=depth, displacement=None)
    gaussians = image_gaussians(build_layered_image(image, image, maps, MARGIN), torch.zeros(2))
    view = render(gaussians.gaussians, camera, settings=RenderSettings(dilation_px2=0.0)).rgb
    rmse = float((view - rgb).square().mean().sqrt())
    assert -20 * math.log10(rmse) > least_db


def test_lenses_of_photographs_lose_no_cell() -> None:
    for fov_deg in (10.0, 60.0, 90.0):
        camera = extended_camera(pinhole(focal_from_fov(fov_deg, 96), (96, 96)), MARGIN)
        assert bool(is_drawable(camera).all())
