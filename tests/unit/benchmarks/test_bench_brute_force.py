"""The harness's truth against the nested NumPy loops of the tests, and against differences."""

from dataclasses import fields, replace

import numpy as np
import oracles_render
import pytest
import torch
from ground_truth import brute_force
from ground_truth.brute_force import gradients, look
from ground_truth.pixel_samples import find_truth, read, sample, save
from oracles_render import random_gaussians, small_camera
from scenes import TINY, Scene, coincident

from diff4splat.render.settings import RenderSettings


def all_pixels(camera) -> torch.Tensor:
    return torch.arange(camera.size_px[0] * camera.size_px[1])


@pytest.mark.parametrize("bands", [1, 4])
def test_colours_are_those_of_the_nested_loops(bands: int) -> None:
    gaussians, camera = random_gaussians(40, bands=bands), small_camera()
    want = oracles_render.brute_force(gaussians, camera, RenderSettings())
    found = look(gaussians, camera, all_pixels(camera))
    np.testing.assert_allclose(found.rgb.numpy(), want.rgb.reshape(-1, 3), atol=1e-13)


def test_the_cap_and_the_cutoff_hold() -> None:
    gaussians, camera = random_gaussians(20), small_camera()
    opaque = replace(
        gaussians,
        opacities=torch.full_like(gaussians.opacities, 1.0),
        scales=50 * gaussians.scales,
    )
    want = oracles_render.brute_force(opaque, camera, RenderSettings())
    found = look(opaque, camera, all_pixels(camera))
    np.testing.assert_allclose(found.rgb.numpy(), want.rgb.reshape(-1, 3), atol=1e-13)
    faint = replace(gaussians, opacities=torch.full_like(gaussians.opacities, 0.9 / 255))
    assert not look(faint, camera, all_pixels(camera)).rgb.any()


def test_far_beyond_the_picture_footprints_follow_its_edge() -> None:
    gaussians, camera = random_gaussians(20), small_camera()
    aside = replace(
        gaussians,
        means=gaussians.means * torch.tensor([3.0, 3.0, 1.0]),
        scales=3 * gaussians.scales,
    )
    want = oracles_render.brute_force(aside, camera, RenderSettings())
    found = look(aside, camera, all_pixels(camera))
    assert found.rgb.any()
    np.testing.assert_allclose(found.rgb.numpy(), want.rgb.reshape(-1, 3), atol=1e-13)


def test_doubt_is_an_alpha_at_the_cutoff() -> None:
    gaussians, camera = random_gaussians(60), small_camera((40, 40))
    want = oracles_render.brute_force(gaussians, camera, RenderSettings(alpha_max=0.99))
    found = look(gaussians, camera, all_pixels(camera)).doubtful.numpy()
    assert found.any()
    # The loops also doubt where half of the light is left.
    assert not (found & (want.doubtful.reshape(-1) == 0)).any()


def test_blended_pairs_end_where_light_does() -> None:
    gaussians, camera = random_gaussians(1), small_camera((5, 5))
    stack = replace(
        gaussians,
        **{f.name: getattr(gaussians, f.name).repeat_interleave(30, 0) for f in fields(gaussians)},
    )
    stack = replace(stack, opacities=torch.full((30,), 0.9), scales=torch.full((30, 3), 50.0))
    blended = look(stack, camera, all_pixels(camera)).blended
    # 0.1 to the fourth is 1e-4 but for the slow fall of the footprint, which leaves a little more.
    assert set(blended.tolist()) == {5}


@pytest.mark.parametrize("chunk", [1, 40, 10_000_000])
def test_chunks_change_nothing(chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    gaussians, camera = random_gaussians(20), small_camera((6, 7))
    pixels = torch.tensor([41, 3, 17, 20])
    grad = torch.randn(4, 3, dtype=torch.float64)
    want, slopes = look(gaussians, camera, pixels), gradients(gaussians, camera, pixels, grad)
    monkeypatch.setattr(brute_force, "_CHUNK", chunk)
    torch.testing.assert_close(look(gaussians, camera, pixels).rgb, want.rgb)
    again = gradients(gaussians, camera, pixels, grad)
    for field in fields(again):
        torch.testing.assert_close(getattr(again, field.name), getattr(slopes, field.name))


@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities", "sh"])
def test_gradients_are_differences(name: str) -> None:
    gaussians, camera = random_gaussians(8, bands=4), small_camera((6, 7))
    pixels = all_pixels(camera)
    sure = pixels[~look(gaussians, camera, pixels).doubtful]
    grad = torch.randn(len(sure), 3, dtype=torch.float64)
    found = getattr(gradients(gaussians, camera, sure, grad), name)
    value, step = getattr(gaussians, name), 1e-6
    direction = torch.randn_like(value)

    def loss(sign: float) -> torch.Tensor:
        moved = replace(gaussians, **{name: value + sign * step * direction})
        return (look(moved, camera, sure).rgb * grad).sum()

    difference = (loss(1.0) - loss(-1.0)) / (2 * step)
    torch.testing.assert_close((found * direction).sum(), difference, rtol=1e-6, atol=1e-8)


def test_nothing_in_view_is_black_and_has_no_gradient() -> None:
    gaussians, camera = random_gaussians(3), small_camera((4, 4))
    behind = replace(gaussians, means=gaussians.means * torch.tensor([1.0, 1.0, -1.0]))
    pixels = all_pixels(camera)
    assert not look(behind, camera, pixels).rgb.any()
    found = gradients(behind, camera, pixels, torch.ones(16, 3))
    assert not any(getattr(found, field.name).any() for field in fields(found))


def test_samples_are_distinct_pixels_of_the_picture() -> None:
    gaussians, camera = TINY[0].build()
    index, uniform = sample(gaussians, camera, 300, torch.Generator().manual_seed(0))
    assert uniform == 150
    assert len(torch.unique(index)) == len(index) > uniform
    assert index.min() >= 0
    assert index.max() < 32 * 32


def test_truth_survives_its_file(tmp_path) -> None:
    truth = find_truth(TINY[1])
    save(truth, tmp_path / "truth.pt")
    again = read(tmp_path / "truth.pt")
    assert torch.equal(again.pixels.rgb, truth.pixels.rgb)
    assert torch.equal(again.gradients.sh, truth.gradients.sh)
    assert again.blended_pairs == truth.blended_pairs
    dense = truth.grad_rgb((32, 32)).flatten(0, 1)
    assert torch.equal(dense[truth.grad_index], truth.grad)
    assert int(dense.any(1).sum()) == len(truth.grad_index)


def test_pairs_of_the_whole_picture_are_estimated_from_uniform_pixels() -> None:
    # All of it in one corner of the picture, where the other half of the pixels is taken from.
    scene = Scene(name="spot", count=20, size_px=(128, 128), make=coincident)
    gaussians, camera = scene.build()
    exact = int(look(gaussians, camera, all_pixels(camera)).blended.sum())
    assert find_truth(scene, with_gradients=False).blended_pairs == pytest.approx(exact, rel=0.3)
