"""The scenes are what their descriptions say."""

from dataclasses import fields
from functools import partial

import pytest
import torch
from ground_truth.brute_force import project
from scenes import SCENES, TINY, Look, Scene, choose, cloud, coincident

from diff4splat.errors import ConfigError


def small(make, count: int, size_px: tuple[int, int] = (36, 64)) -> Scene:
    return Scene(name="small", count=count, size_px=size_px, make=make)


def radius_px(precision: torch.Tensor) -> torch.Tensor:
    xx, xy, yy = precision.unbind(-1)
    return 3 * (xx * yy - xy * xy) ** -0.25


@pytest.mark.parametrize("name", ["cloud-10k-256", "aligned-256", "huge-512"])
def test_building_twice_gives_equal_bits(name: str) -> None:
    first, second = SCENES[name].build()[0], SCENES[name].build()[0]
    for field in fields(first):
        assert torch.equal(getattr(first, field.name), getattr(second, field.name))


def test_every_scene_says_its_size() -> None:
    for scene in SCENES.values():
        if scene.count <= 65_536:
            gaussians, camera = scene.build()
            assert len(gaussians) == scene.count
            assert camera.size_px == scene.size_px
            assert gaussians.degree == scene.degree


@pytest.mark.parametrize("low_high", [(3.0, 6.0), (30.0, 60.0)])
def test_radii_of_a_cloud_are_uniform_in_their_range(low_high: tuple[float, float]) -> None:
    scene = small(partial(cloud, Look(radius_px=low_high)), 4_000, (360, 640))
    gaussians, camera = scene.build()
    radius = radius_px(project(gaussians, camera).precision)
    low, high = low_high
    # The axes are uneven by up to 10 %, which the footprint sees only in part.
    assert radius.min() > 0.88 * low
    assert radius.max() < 1.12 * high
    quarters = torch.tensor([0.25, 0.5, 0.75])
    expected = low + (high - low) * quarters
    torch.testing.assert_close(radius.quantile(quarters), expected, rtol=0.04, atol=0.0)


def test_a_cloud_fills_the_picture() -> None:
    gaussians, camera = small(partial(cloud, Look()), 4_000).build()
    center = project(gaussians, camera).center
    height, width = camera.size_px
    counts = torch.histogramdd(center, [4, 4], range=[0.0, width, 0.0, height]).hist
    assert counts.sum() == 4_000
    assert counts.min() > 180, "250 are expected in each sixteenth"
    assert (gaussians.opacities >= 0.1).all()
    assert (gaussians.opacities <= 0.9).all()


def test_aligned_gaussians_stand_at_pixel_centres() -> None:
    gaussians, camera = SCENES["aligned-256"].build()
    exact = project(gaussians.to(torch.float64), camera.to(torch.float64))
    found = torch.sort((exact.center - 0.5).round().long() @ torch.tensor([1, 256])).values
    assert torch.equal(found, torch.arange(256 * 256))
    assert ((exact.center - 0.5) - (exact.center - 0.5).round()).abs().max() < 1e-3
    assert (gaussians.opacities >= 0.5).all()
    assert (gaussians.opacities <= 0.99).all()


def test_the_huge_one_reaches_every_corner() -> None:
    gaussians, camera = SCENES["huge-512"].build()
    splats = project(gaussians, camera)
    for corner in ([0.5, 0.5], [511.5, 0.5], [0.5, 511.5], [511.5, 511.5]):
        dx, dy = (torch.tensor(corner) - splats.center[0]).tolist()
        xx, xy, yy = splats.precision[0].tolist()
        response = 0.9 * torch.exp(-0.5 * torch.tensor(xx * dx**2 + 2 * xy * dx * dy + yy * dy**2))
        assert response > 0.1


def test_coincident_ones_share_place_and_shape() -> None:
    gaussians, camera = small(coincident, 50, (64, 64)).build()
    splats = project(gaussians, camera)
    assert len(torch.unique(splats.center, dim=0)) == 1
    assert len(torch.unique(splats.precision, dim=0)) == 1
    torch.testing.assert_close(radius_px(splats.precision)[0].item(), 12.0, rtol=0.1, atol=0.0)
    assert len(torch.unique(gaussians.opacities)) == 50


def test_tiny_scenes_have_every_degree() -> None:
    assert [scene.build()[0].degree for scene in TINY.values()] == [0, 1, 2, 3]


def test_choosing_by_pattern_keeps_the_order() -> None:
    names = [scene.name for scene in choose(["aligned-*", "cloud-10k-256"])]
    assert names == ["cloud-10k-256", "aligned-256", "aligned-512"]
    assert len(choose(["*"])) == len(SCENES)


def test_an_unknown_scene_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"expected names among cloud-10k-256.*, got nowhere"):
        choose(["cloud-*", "nowhere"])
