"""Footprints and their gradients against a Cholesky factor in float64."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_raster import (
    BASE,
    LENS,
    as_arrays,
    assert_gradients_agree,
    cloud,
    double,
    lens_leaves,
    local_means,
    shape_gradient,
    shapes,
    wide_camera,
)
from oracles_render import small_camera
from torch import Tensor

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.render.raster import forward
from diff4splat.render.raster.projection.project_backward import CAMERA_COLUMNS, project_backward
from diff4splat.render.raster.raster_settings import RasterSettings, make_raster_settings, make_view
from diff4splat.render.raster.tables import MOMENTS, Cloud, View
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians

SETTINGS = {
    "plain": RenderSettings(),
    "antialias": RenderSettings(antialias=True, dilation_px2=0.7),
    "no dilation": RenderSettings(dilation_px2=0.0),
    "both": RenderSettings(antialias=True, dilation_px2=0.0),
}
CAMERAS = {"straight": wide_camera(), "turned": small_camera((20, 33), torch.float32)}
SHAPE_COLUMNS = 6
LARGEST = float(np.finfo(np.float32).max) ** 0.5


def stage(camera: Camera, own: RenderSettings) -> tuple[RasterSettings, View]:
    plan = make_raster_settings(camera, own, colors=True, medians=False)
    return plan, make_view(plan.grid, camera.world_from_camera, camera.focal_px, camera.center_px)


def project(
    gaussians: Gaussians, camera: Camera, own: RenderSettings = SETTINGS["plain"]
) -> forward.Footprints:
    plan, view = stage(camera, own)
    arrays = as_arrays(gaussians)
    return forward.footprints(Cloud(*arrays[:4]), arrays[4], view, plan)


def scattered(count: int = 60, seed: int = 0) -> Gaussians:
    """On the image, beyond it, and beyond the guard band."""
    gaussians = cloud(count, seed, spread_px=12.0)
    return replace(gaussians, means=gaussians.means * torch.tensor([2.5, 2.5, 1.0]))


def half_sides(shape: Tensor, own: RenderSettings) -> Tensor:
    """Of the box around the ellipse where the opacity is the cutoff: u² + v² = radius² there."""
    radius = (shape[:, 5] - math.log2(own.alpha_cutoff)).clamp_min(0).sqrt()
    whiten_x, shear, whiten_y = shape[:, 2:5].unbind(1)
    tall = torch.hypot(shear / (whiten_y * whiten_x), 1 / whiten_y)
    return radius[:, None] * torch.stack([1 / whiten_x, tall], -1)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
@pytest.mark.parametrize("own", SETTINGS.values(), ids=SETTINGS)
def test_footprints_are_those_of_the_covariance(own: RenderSettings, camera: Camera) -> None:
    gaussians = scattered()
    found = project(gaussians, camera, own)
    wide, lens = gaussians.to(torch.float64), camera.to(torch.float64)
    want, z = shapes(wide, lens, own).numpy(), local_means(wide, lens)[:, 2].numpy()
    seen = found.order
    assert 15 < len(seen) < 60
    got = found.prints[seen]
    np.testing.assert_allclose(got[:, :SHAPE_COLUMNS], want[seen], rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(found.depth[seen], z[seen], rtol=1e-7)
    np.testing.assert_array_equal(seen, seen[np.argsort(found.depth[seen], kind="stable")])
    # u² + v² at the cutoff, and the half sides of the box around that ellipse.
    extent = half_sides(torch.from_numpy(want[seen]), own).numpy()
    np.testing.assert_allclose(got[:, SHAPE_COLUMNS:], extent, rtol=2e-4, atol=2e-3)
    assert bool((got[:, SHAPE_COLUMNS:] >= extent).all())


def test_some_lie_beyond_the_guard_band() -> None:
    # Otherwise the test above would not see the clamp.
    camera = CAMERAS["straight"]
    seen = project(scattered(), camera).order
    x, _, z = local_means(scattered(), camera)[seen].unbind(-1)
    aside = 60 * x / z + camera.center_px[0]
    assert int(((aside < -0.15 * 91) | (aside > 1.15 * 91)).sum()) >= 3


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(list(SETTINGS.values())))
def test_who_reaches_no_pixel_is_left_out_and_nobody_else(seed: int, own: RenderSettings) -> None:
    gaussians, camera = scattered(30, seed), CAMERAS["straight"]
    wide, lens = gaussians.to(torch.float64), camera.to(torch.float64)
    shape = shapes(wide, lens, own)
    extent = half_sides(shape, own)
    size = torch.tensor([91.0, 67.0], dtype=torch.float64)
    gap = torch.maximum(0.5 - shape[:, :2] - extent, shape[:, :2] - extent - (size - 0.5))
    reaches = shape[:, 5] >= np.log2(own.alpha_cutoff)
    found = set(project(gaussians, camera, own).order.tolist())
    assert found >= set((reaches & (gap <= 0).all(-1)).nonzero()[:, 0].tolist())
    assert found <= set((reaches & (gap <= 0.05).all(-1)).nonzero()[:, 0].tolist())


FAULTS = ("means", "quats", "scales", "opacities", "sh")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), 1.0001 * LARGEST])
def test_faults_are_counted_by_the_first(value: float) -> None:
    gaussians = cloud(9000, bands=4)
    spoilt = {name: getattr(gaussians, name).clone() for name in FAULTS}
    for column, name in enumerate(FAULTS):
        # Number i has all faults from the i-th on; some in another part of the work.
        rows = torch.cat([torch.arange(column + 1), 8900 + torch.arange(column + 1)])
        spoilt[name].view(9000, -1)[rows, -1] = value
    found = project(Gaussians(**spoilt), CAMERAS["straight"])
    assert found.unusable.tolist() == [2, 2, 2, 2, 2]
    left_out = {*range(5), *range(8900, 8905)}
    assert not left_out & set(found.order.tolist())


def test_what_can_just_be_squared_is_usable() -> None:
    gaussians = cloud(5)
    bright = torch.full_like(gaussians.sh, -0.9999 * LARGEST)
    assert project(replace(gaussians, sh=bright), CAMERAS["straight"]).unusable.sum() == 0


def one(**changes: object) -> Gaussians:
    """One Gaussian on the axis."""
    base = {
        "means": [0.0, 0.0, 2.0],
        "quats": [1.0, 0.0, 0.0, 0.0],
        "scales": [0.1, 0.1, 0.1],
        "opacities": 0.5,
    }
    values = {name: torch.tensor([changes.get(name, value)]) for name, value in base.items()}
    return Gaussians(**values, sh=torch.zeros(1, 1, 3))


@pytest.mark.parametrize(
    ("changes", "own", "seen"),
    [
        ({"means": [0.0, 0.0, 0.0101]}, {}, 1),
        ({"means": [0.0, 0.0, 0.0099]}, {}, 0),
        ({"means": [0.0, 0.0, 0.0099]}, {"near_depth": 1e-3}, 1),
        ({"means": [0.0, 0.0, -2.0]}, {}, 0),
        ({"opacities": 1.001 / 255}, {}, 1),
        ({"opacities": 0.999 / 255}, {}, 0),
        ({"opacities": 0.0}, {}, 0),
        ({"opacities": -1.0}, {}, 0),
        ({"opacities": 3.0}, {}, 1),
        ({"scales": [0.0, 0.0, 0.0]}, {}, 1),
        ({"scales": [0.0, 0.0, 0.0]}, {"antialias": True}, 0),
        ({"scales": [0.0, 0.0, 0.0]}, {"dilation_px2": 0.0}, 0),
        # 60 px focal length at depth 2: a millionth of a pixel is 3.3e-8.
        ({"scales": [0.1, 4e-8, 4e-8]}, {"dilation_px2": 0.0}, 1),
        ({"scales": [0.1, 3e-8, 3e-8]}, {"dilation_px2": 0.0}, 0),
        ({"quats": [0.0, 0.0, 0.0, 0.0]}, {}, 1),
    ],
)
def test_who_is_seen(changes: dict, own: dict, seen: int) -> None:
    camera = pinhole(60.0, (21, 21))
    assert len(project(one(**changes), camera, RenderSettings(**own)).order) == seen


def test_a_zero_quaternion_is_the_identity() -> None:
    camera = pinhole(60.0, (21, 21))
    plain = project(one(scales=[0.1, 0.05, 0.02]), camera).prints
    zero = project(one(scales=[0.1, 0.05, 0.02], quats=[0.0] * 4), camera).prints
    np.testing.assert_array_equal(plain, zero)
    assert plain[0, 2] == pytest.approx(BASE / (9 + 0.3) ** 0.5)


def test_far_from_the_origin_nothing_is_lost() -> None:
    gaussians, camera = scattered(), CAMERAS["turned"]
    # 4096 + k / 256 is exact in float32.
    shift = torch.tensor([4096.0, -4096.0, 4096.0])
    rounded = replace(gaussians, means=(gaussians.means * 256).round() / 256)
    pose = camera.world_from_camera.clone()
    pose[:3, 3] = (pose[:3, 3] * 256).round() / 256
    near = project(rounded, camera.with_pose(pose))
    away = pose.clone()
    away[:3, 3] += shift
    far = project(replace(rounded, means=rounded.means + shift), camera.with_pose(away))
    np.testing.assert_array_equal(far.order, near.order)
    np.testing.assert_array_equal(far.prints[far.order], near.prints[near.order])


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
@pytest.mark.parametrize("own", SETTINGS.values(), ids=SETTINGS)
def test_gradients_of_footprints(own: RenderSettings, camera: Camera) -> None:
    gaussians = scattered(80)
    plan, view = stage(camera, own)
    found = project(gaussians, camera, own)
    listed = found.visible
    moments = np.random.default_rng(0).standard_normal((80, MOMENTS)).astype(np.float32)
    arrays = as_arrays(gaussians)[:4]
    grads = Cloud(*(np.zeros_like(array) for array in arrays))
    to_camera = np.zeros(CAMERA_COLUMNS)
    project_backward(
        0, len(listed), listed, Cloud(*arrays), view, plan.rules, found.prints, moments, grads,
        to_camera,
    )  # fmt: skip
    wide, lens = double(gaussians), lens_leaves(camera, torch.float64)
    want = shapes(wide.select(torch.from_numpy(listed).long()), lens, own)
    incoming = shape_gradient(want.detach(), torch.from_numpy(moments[listed]).double())
    (want * incoming).sum().backward()
    for name, array in zip(Cloud._fields, grads, strict=True):
        assert_gradients_agree(torch.from_numpy(array), getattr(wide, name).grad, name, 1e-6)
    pose, focal, center = (getattr(lens, name).grad for name in LENS)
    whole = torch.cat([pose[:3, :3].flatten(), pose[:3, 3], focal, center])
    assert_gradients_agree(torch.from_numpy(to_camera), whole, "camera", 1e-9)
