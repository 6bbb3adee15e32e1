"""Lists per tile against asking every pixel of every tile for every Gaussian."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_raster import (
    as_arrays,
    cloud,
    meets_rectangle,
    responses,
    shapes,
    wide_camera,
)

from diff4splat.geometry.camera import Camera
from diff4splat.render.raster import forward
from diff4splat.render.raster.raster_settings import (
    TILE_SIZES_PX,
    RasterSettings,
    make_raster_settings,
    make_view,
)
from diff4splat.render.raster.tables import Cloud
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians

CAMERA = wide_camera()


def project(gaussians: Gaussians, camera: Camera, plan: RasterSettings) -> forward.Footprints:
    arrays = as_arrays(gaussians)
    view = make_view(plan.grid, camera.world_from_camera, camera.focal_px, camera.center_px)
    return forward.footprints(Cloud(*arrays[:4]), arrays[4], view, plan)


def lists(
    found: forward.Footprints, plan: RasterSettings
) -> tuple[dict[int, list[int]], forward.Filled]:
    """Members of every tile, region by region, and the last region."""
    binned, made = forward.bin_footprints(found, plan), {}
    for region in binned.regions:
        filled = forward.fill_region(found, plan.grid, binned, region)
        starts, members = filled.lists.starts, filled.lists.members
        top, bottom, left, right = region
        for tile in range(len(starts) - 1):
            inside = members[starts[tile] : starts[tile + 1]].tolist()
            row, column = divmod(tile, plan.grid.columns)
            if top <= row < bottom and left <= column < right:
                assert tile not in made
                made[tile] = inside
            else:
                assert not inside
    assert len(made) == plan.grid.rows * plan.grid.columns
    return made, filled


def planned(camera: Camera, **changes: object) -> tuple[RasterSettings, RenderSettings]:
    own = RenderSettings(**changes)
    return make_raster_settings(camera, own, colors=True, medians=False), own


def rectangle(tile: int, plan: RasterSettings) -> tuple[float, float, float, float]:
    """First and last pixel centre (x0, y0, x1, y1) of a tile."""
    edge, (row, column) = plan.grid.edge, divmod(tile, plan.grid.columns)
    return (
        column * edge + 0.5,
        row * edge + 0.5,
        (column + 1) * edge - 0.5,
        (row + 1) * edge - 0.5,
    )


def assert_complete_and_ordered(gaussians: Gaussians, camera: Camera, **changes: object) -> None:
    plan, own = planned(camera, **changes)
    found = project(gaussians, camera, plan)
    made, _ = lists(found, plan)
    exact = shapes(gaussians.to(torch.float64), camera.to(torch.float64), own)
    needed = (responses(exact, camera.size_px) >= own.alpha_cutoff).numpy()
    rank = {index: position for position, index in enumerate(found.order.tolist())}
    edge = plan.grid.edge
    for tile, members in made.items():
        row, column = divmod(tile, plan.grid.columns)
        pixels = needed[:, row * edge : (row + 1) * edge, column * edge : (column + 1) * edge]
        missing = set(pixels.any((1, 2)).nonzero()[0].tolist()) - set(members)
        assert not missing, f"tile {tile} lacks {missing}"
        ranks = [rank[index] for index in members]
        assert ranks == sorted(set(ranks))


@pytest.mark.parametrize("spread_px", [0.3, 2.0, 12.0])
@pytest.mark.parametrize("tile_px", TILE_SIZES_PX)
def test_who_reaches_a_pixel_is_on_its_list(tile_px: int, spread_px: float) -> None:
    gaussians = cloud(120, spread_px=spread_px)
    assert_complete_and_ordered(gaussians, CAMERA, tile_px=tile_px, dilation_px2=0.0)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([8, 16]), st.floats(1e-6, 0.1), st.booleans())
def test_lists_are_complete(seed: int, tile_px: int, cutoff: float, antialias: bool) -> None:
    gaussians = cloud(15, seed, spread_px=1 + seed % 9)
    # Needles at all angles.
    thin = gaussians.scales * torch.tensor([4.0, 0.1, 0.1])
    camera = wide_camera((25, 42))
    assert_complete_and_ordered(
        replace(gaussians, scales=thin),
        camera,
        tile_px=tile_px,
        alpha_cutoff=cutoff,
        antialias=antialias,
    )


@pytest.mark.parametrize("spread_px", [2.0, 12.0])
@pytest.mark.parametrize("tile_px", [8, 32])
def test_lists_hold_little_else(tile_px: int, spread_px: float) -> None:
    gaussians = cloud(120, spread_px=spread_px)
    plan, own = planned(CAMERA, tile_px=tile_px)
    found = project(gaussians, CAMERA, plan)
    made, _ = lists(found, plan)
    exact = shapes(gaussians.to(torch.float64), CAMERA.to(torch.float64), own).numpy()
    pairs = [(index, rectangle(tile, plan)) for tile, inside in made.items() for index in inside]
    useless = [
        (index, box)
        for index, box in pairs
        if not meets_rectangle(exact[index], box, own.alpha_cutoff)
    ]
    assert len(useless) <= 0.02 * len(pairs)
    # Inside the image, lists are made for whole pixels: nobody is a pixel off.
    for index, (x0, y0, x1, y1) in useless:
        x, y, *_, extent_x, extent_y = found.prints[index]
        if abs(x - 45.5) + extent_x < 45.5 and abs(y - 33.5) + extent_y < 33.5:
            grown = (x0 - 1, y0 - 1, x1 + 1, y1 + 1)
            assert meets_rectangle(exact[index], grown, 0.99 * own.alpha_cutoff), index


def test_every_pair_has_one_slot_and_a_gaussian_has_neighbours() -> None:
    plan, _ = planned(CAMERA, tile_px=8)
    found = project(cloud(9000, spread_px=1.5), CAMERA, plan)
    made, filled = lists(found, plan)
    slots, members = filled.lists.slots, filled.lists.members
    np.testing.assert_array_equal(np.sort(slots), np.arange(len(members)))
    owner = np.empty_like(members)
    owner[slots] = members
    sizes = np.diff(filled.first_slots)
    np.testing.assert_array_equal(owner, np.repeat(found.order, sizes))
    # Row by row of tiles, so that sums have one order.
    tile = np.empty(len(members), np.int64)
    tile[slots] = np.repeat(np.arange(len(made)), np.diff(filled.lists.starts))
    same = owner[1:] == owner[:-1]
    assert bool((np.diff(tile)[same] > 0).all())


@pytest.mark.parametrize("limit", [1, 30, 1000, 10**6])
def test_regions_have_the_lists_of_the_whole(limit: int) -> None:
    plan, _ = planned(CAMERA, tile_px=8)
    found = project(cloud(5000), CAMERA, plan)
    whole, _ = lists(found, plan)
    small = replace(plan, pair_limit=limit)
    assert lists(found, small)[0] == whole
    for top, bottom, left, right in forward.bin_footprints(found, small).regions:
        tiles = [r * plan.grid.columns + c for r in range(top, bottom) for c in range(left, right)]
        assert len(tiles) == 1 or sum(len(whole[tile]) for tile in tiles) <= limit


def test_nobody_has_empty_lists() -> None:
    plan, _ = planned(CAMERA, tile_px=32)
    nobody = cloud(3).select(torch.zeros(0, dtype=torch.long))
    made, filled = lists(project(nobody, CAMERA, plan), plan)
    assert made == {tile: [] for tile in range(9)}
    assert filled.first_slots.tolist() == [0]
