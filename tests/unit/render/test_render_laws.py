"""Laws that every image obeys."""

from dataclasses import replace

import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_render import random_gaussians, small_camera

from diff4splat.geometry import quaternion, rigid
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import concatenate

SEEDS = st.integers(0, 10_000)
CONTINUOUS = RenderSettings(alpha_cutoff=1e-12)
IMAGES = ("rgb", "alpha", "depth")


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_moving_the_world_with_the_camera_changes_nothing(seed: int) -> None:
    gaussians, camera = random_gaussians(12, seed, bands=1), small_camera((6, 7))
    generator = torch.Generator().manual_seed(seed)
    quat = torch.randn(4, generator=generator, dtype=torch.float64)
    shift = 5 * torch.randn(3, generator=generator, dtype=torch.float64)
    motion = rigid.from_parts(quaternion.to_matrix(quat), shift)
    moved = replace(
        gaussians,
        means=rigid.transform_points(motion, gaussians.means),
        quats=quaternion.multiply(quaternion.normalize(quat).expand(12, 4), gaussians.quats),
    )
    before = render(gaussians, camera, outputs=IMAGES, settings=CONTINUOUS)
    after = render(
        moved,
        camera.with_pose(motion @ camera.world_from_camera),
        outputs=IMAGES,
        settings=CONTINUOUS,
    )
    for name in IMAGES:
        torch.testing.assert_close(getattr(after, name), getattr(before, name), rtol=0, atol=1e-9)


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_clear_gaussians_change_nothing(seed: int) -> None:
    gaussians, camera = random_gaussians(12, seed), small_camera((6, 7))
    clear = random_gaussians(5, seed + 1)
    clear = replace(clear, opacities=torch.zeros_like(clear.opacities))
    mixed = concatenate([clear, gaussians, clear])
    assert torch.equal(render(mixed, camera).rgb, render(gaussians, camera).rgb)


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_the_order_of_the_list_does_not_matter(seed: int) -> None:
    gaussians, camera = random_gaussians(12, seed), small_camera((6, 7))
    order = torch.randperm(12, generator=torch.Generator().manual_seed(seed))
    assert torch.equal(render(gaussians.select(order), camera).rgb, render(gaussians, camera).rgb)


@settings(max_examples=15, deadline=None)
@given(SEEDS, st.floats(0.01, 100.0))
def test_the_unit_of_length_does_not_matter(seed: int, factor: float) -> None:
    gaussians, camera = random_gaussians(12, seed), small_camera((6, 7))
    pose = camera.world_from_camera.clone()
    pose[:3, 3] *= factor
    larger = replace(gaussians, means=gaussians.means * factor, scales=gaussians.scales * factor)
    near = RenderSettings(alpha_cutoff=1e-12, near_depth=1e-6)
    torch.testing.assert_close(
        render(larger, camera.with_pose(pose), settings=near).rgb,
        render(gaussians, camera, settings=near).rgb,
        rtol=0,
        atol=1e-9,
    )


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_a_cropped_camera_sees_the_crop(seed: int) -> None:
    # The guard band moves with the image, so only Gaussians well inside are compared.
    gaussians, camera = random_gaussians(12, seed), small_camera((16, 16))
    inside = replace(gaussians, means=gaussians.means * torch.tensor([0.3, 0.3, 1.0]))
    whole = render(inside, camera, settings=CONTINUOUS).rgb
    part = render(inside, camera.cropped((1, 2), (14, 13)), settings=CONTINUOUS).rgb
    torch.testing.assert_close(part, whole[1:15, 2:15], rtol=0, atol=1e-9)


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_weights_and_light_add_up_to_one(seed: int) -> None:
    gaussians, camera = random_gaussians(12, seed, bands=1), small_camera((6, 7))
    white = replace(gaussians, sh=torch.full_like(gaussians.sh, 0.5 / 0.28209479177387814))
    made = render(white, camera, settings=RenderSettings(background=(1.0, 1.0, 1.0)))
    torch.testing.assert_close(made.rgb, torch.ones_like(made.rgb))
