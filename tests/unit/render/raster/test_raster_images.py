"""Images of the CPU kernels against float64: two nested loops, and a dense table."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_raster import Dense, cloud, dense, psnr_db, render_raster, stack, wide_camera
from oracles_render import brute_force, random_gaussians, small_camera

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.render.api import render
from diff4splat.render.raster.raster_settings import TILE_SIZES_PX
from diff4splat.render.settings import OUTPUTS, RenderOutput, RenderSettings
from diff4splat.scene.gaussians import Gaussians

LOOPED = ("rgb", "alpha", "depth", "median_depth")
CAMERA = wide_camera()
LATER = CAMERA.with_pose(
    torch.tensor(
        [[1.0, 0, 0, 0.1], [0, 1, 0, 0.2], [0, 0, 1, -0.1], [0, 0, 0, 1]], dtype=torch.float32
    )
)
ALL = {
    "plain": {},
    "antialias": {"antialias": True},
    "no dilation": {"dilation_px2": 0.0},
    "much dilation": {"dilation_px2": 4.0, "antialias": True},
    "far support": {"alpha_cutoff": 1e-9},
    "near support": {"alpha_cutoff": 0.1},
    "thin air": {"alpha_max": 0.3},
    "background": {"background": (0.2, 0.5, 1.0)},
    "early end": {"light_cutoff": 0.4},
    "late end": {"light_cutoff": 1e-30},
    "near plane": {"near_depth": 2.5},
    "tiles of 8": {"tile_px": 8},
    "tiles of 16": {"tile_px": 16},
    "tiles of 64": {"tile_px": 64},
}


def exact(gaussians: Gaussians, camera: Camera, own: RenderSettings) -> Dense:
    features = None if own.features is None else own.features.double()
    later = None if own.flow_camera is None else own.flow_camera.to(torch.float64)
    wide = replace(own, features=features, flow_camera=later)
    return dense(gaussians.to(torch.float64), camera.to(torch.float64), wide)


def assert_right(made: RenderOutput, want: Dense, least_db: float = 120.0) -> None:
    """Every image that was made, pixel by pixel and in the mean."""
    assert want.unsure_share < 0.03
    for name in OUTPUTS:
        got = getattr(made, name)
        if got is None:
            continue
        unsure = want.median_unsure if name == "median_depth" else want.unsure
        # Displacements are differences of pixels in float32.
        floor = least_db - 15 if name == "flow" else least_db
        assert psnr_db(got, getattr(want, name), unsure) >= floor, name
        signed = (got.double() - getattr(want, name))[~unsure].mean()
        assert abs(float(signed)) <= 2e-6, name


@pytest.mark.parametrize("size_px", [(13, 17), (32, 8), (1, 1)])
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"dilation_px2": 0.0, "background": (0.2, 0.5, 1.0)},
        {"dilation_px2": 1.0, "antialias": True, "alpha_max": 0.6, "alpha_cutoff": 0.02},
        {"alpha_cutoff": 1e-6, "tile_px": 8},
    ],
)
def test_two_nested_loops_agree(changes: dict, size_px: tuple[int, int]) -> None:
    own = RenderSettings(light_cutoff=1e-30, **changes)
    gaussians = random_gaussians(30, bands=4, dtype=torch.float32)
    camera = small_camera(size_px, torch.float32)
    want = brute_force(gaussians, camera, own)
    made = render(gaussians, camera, outputs=LOOPED, settings=own, backend="raster")
    unsure = torch.from_numpy(want.doubtful > 0)
    assert float(unsure.double().mean()) <= 0.1
    for name in LOOPED:
        exactly = torch.from_numpy(getattr(want, name))
        assert psnr_db(getattr(made, name), exactly, unsure) >= 110, name


def test_the_table_agrees_with_the_loops() -> None:
    own = RenderSettings(light_cutoff=1e-30, antialias=True, background=(0.1, 0.2, 0.3))
    gaussians, camera = random_gaussians(30), small_camera()
    loops, table = brute_force(gaussians, camera, own), dense(gaussians, camera, own)
    for name in LOOPED:
        np.testing.assert_allclose(getattr(table, name), getattr(loops, name), atol=1e-12)


@pytest.mark.parametrize("spread_px", [1.0, 9.0])
@pytest.mark.parametrize("changes", ALL.values(), ids=ALL)
def test_every_image_is_right(changes: dict, spread_px: float) -> None:
    gaussians = cloud(150, bands=16, spread_px=spread_px)
    own = RenderSettings(flow_camera=LATER, features=torch.rand(150, 2), **changes)
    made = render(gaussians, CAMERA, outputs=OUTPUTS, settings=own, backend="raster")
    assert_right(made, exact(gaussians, CAMERA, own))


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10_000),
    st.tuples(st.integers(1, 70), st.integers(1, 70)),
    st.sampled_from(list(ALL.values())),
    st.floats(0.2, 15.0),
)
def test_random_scenes(seed: int, size_px: tuple[int, int], changes: dict, spread: float) -> None:
    gaussians, camera = cloud(40, seed, bands=4, spread_px=spread), wide_camera(size_px)
    own = RenderSettings(**changes)
    want = exact(gaussians, camera, own)
    made = render(gaussians, camera, outputs=LOOPED, settings=own, backend="raster")
    for name in LOOPED:
        unsure = want.median_unsure if name == "median_depth" else want.unsure
        error = (getattr(made, name).double() - getattr(want, name))[~unsure].abs()
        assert error.numel() == 0 or float(error.max()) <= 1e-5, name


@pytest.mark.parametrize("channels", [1, 2, 3, 4, 9])
def test_features_alone(channels: int) -> None:
    gaussians, features = cloud(100), torch.randn(100, channels)
    made = render_raster(gaussians, CAMERA, "features", features=features)
    assert made.features.shape == (67, 91, channels)
    assert made.rgb is None
    assert_right(made, exact(gaussians, CAMERA, RenderSettings(features=features)))


@pytest.mark.parametrize("name", OUTPUTS)
def test_an_image_has_the_same_bits_alone_and_in_company(name: str) -> None:
    gaussians = cloud(100, bands=4)
    own = {"flow_camera": LATER, "features": torch.randn(100, 3)}
    alone = render_raster(gaussians, CAMERA, name, **own)
    together = render_raster(gaussians, CAMERA, *OUTPUTS, **own)
    assert torch.equal(getattr(alone, name), getattr(together, name))
    assert [other for other in OUTPUTS if getattr(alone, other) is not None] == [name]


def test_no_light_is_made_or_lost() -> None:
    gaussians, own = cloud(2000, spread_px=2.0), RenderSettings(light_cutoff=1e-30)
    made = render(gaussians, CAMERA, settings=own, backend="raster").rgb
    want = render(gaussians.to(torch.float64), CAMERA, settings=own, backend="reference").rgb
    error = made.double() - want
    # Flips at the cutoff are worth 1/255 each and fall to either side.
    assert abs(float(error.mean())) <= 2e-7
    assert float((error.abs() > 1e-5).double().mean()) < 1e-3


@pytest.mark.parametrize("tile_px", TILE_SIZES_PX)
def test_tile_sizes_do_not_change_the_image(tile_px: int) -> None:
    gaussians = cloud(400, spread_px=3.0)
    plain = render_raster(gaussians, CAMERA, "rgb", "depth")
    other = render_raster(gaussians, CAMERA, "rgb", "depth", tile_px=tile_px)
    torch.testing.assert_close(other.rgb, plain.rgb, rtol=0, atol=1e-5)
    torch.testing.assert_close(other.depth, plain.depth, rtol=0, atol=1e-4)


def test_equal_depths_keep_the_order_of_the_list() -> None:
    pair = cloud(2).select(torch.tensor([0, 0, 0]))
    pair = replace(pair, opacities=torch.full((3,), 0.9), sh=torch.eye(3)[:, None])
    first = render_raster(pair, CAMERA, "rgb").rgb.sum((0, 1))
    assert bool(first[0] > first[1]) and bool(first[1] > first[2])


def test_a_pixel_full_of_opaque_gaussians_next_to_an_empty_one() -> None:
    camera = pinhole(64.0, (8, 16))
    # Two units ahead, on the centre of pixel (4, 4).
    pile = stack(10_000, 1.0, place=(-3.5 / 64, 0.5 / 64))
    for cutoff in (1e-30, 1e-5):
        alpha = render_raster(pile, camera, "alpha", light_cutoff=cutoff, dilation_px2=0.0).alpha
        assert float(alpha[4, 4]) == pytest.approx(1.0, abs=max(cutoff, 1e-7))
        assert not alpha[:, 8:].any()


def test_nothing_but_background() -> None:
    nobody = cloud(3).select(torch.zeros(0, dtype=torch.long))
    made = render_raster(
        nobody, CAMERA, *OUTPUTS, background=(0.1, 0.2, 0.3), flow_camera=LATER,
        features=torch.zeros(0, 4),
    )  # fmt: skip
    assert torch.equal(made.rgb, torch.tensor([0.1, 0.2, 0.3]).expand(67, 91, 3))
    for name in ("depth", "median_depth", "alpha", "flow", "features"):
        assert not getattr(made, name).any(), name


def test_the_oracle_can_disagree() -> None:
    gaussians, own = cloud(150), RenderSettings()
    made = render(gaussians, CAMERA, settings=replace(own, dilation_px2=0.301), backend="raster")
    with pytest.raises(AssertionError):
        assert_right(made, exact(gaussians, CAMERA, own))
