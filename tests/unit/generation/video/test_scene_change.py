"""What photometric steps change of a scene."""

from math import log

import pytest
import torch
from image_layers import FOCAL_PX, sliding_path

from diff4splat.generation.video.canonical_scene import CanonicalScene
from diff4splat.generation.video.scene_change import (
    OPACITY_EPS,
    RATES,
    CellRays,
    cell_rays,
    changed,
    farther_cells,
    zero_change,
)
from diff4splat.geometry.camera import pinhole
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.scene.gaussians import Gaussians

GRID = (2, 10, 12)
CELLS = torch.tensor([0, 5, 119, 120, 239])
"""Of 240; two in the second key frame."""


def gaussians(count: int = 7, dtype: torch.dtype = torch.float32) -> Gaussians:
    return Gaussians(
        means=torch.randn(count, 3, dtype=dtype) + torch.tensor([0, 0, 4], dtype=dtype),
        quats=torch.nn.functional.normalize(torch.randn(count, 4, dtype=dtype), dim=-1),
        scales=torch.rand(count, 3, dtype=dtype) * 0.1 + 0.01,
        opacities=torch.rand(count, dtype=dtype) * 0.9 + 0.05,
        sh=torch.randn(count, 4, 3, dtype=dtype),
    )


def rays(dtype: torch.dtype = torch.float32) -> CellRays:
    return CellRays(origins=torch.randn(5, 3, dtype=dtype), cell_index=CELLS, grid=GRID)


def test_no_change_is_the_scene() -> None:
    old, about = gaussians(), rays()
    new = changed(old, zero_change(old, about), about)
    for name in ("means", "quats", "scales", "opacities", "sh"):
        torch.testing.assert_close(getattr(new, name), getattr(old, name), rtol=1e-6, atol=1e-6)


def test_every_change_has_a_rate() -> None:
    assert list(zero_change(gaussians(), rays())) == list(RATES)


def test_a_block_depth_moves_cells_away_from_their_camera_and_makes_them_larger() -> None:
    old, about = gaussians(), rays()
    change = zero_change(old, about)
    with torch.no_grad():
        change["block_depths"] += log(2)
    new = changed(old, change, about)
    twice = about.origins + 2 * (old.means[:5] - about.origins)
    torch.testing.assert_close(new.means[:5], twice)
    torch.testing.assert_close(new.scales[:5], 2 * old.scales[:5])
    assert torch.equal(new.means[5:], old.means[5:])
    assert torch.equal(new.scales[5:], old.scales[5:])


def test_block_depths_are_bilinear_between_the_middles_of_blocks() -> None:
    about = CellRays(origins=torch.zeros(256, 3), cell_index=torch.arange(256), grid=(1, 16, 16))
    blocks = torch.tensor([[[[0.0, 1.0], [2.0, 3.0]]]], dtype=torch.float64)
    fine = farther_cells(blocks, about).log().view(16, 16)
    middle = torch.arange(16, dtype=torch.float64).add(0.5).div(8).sub(0.5).clamp(0, 1)
    torch.testing.assert_close(fine, 2 * middle[:, None] + middle[None])


def test_scales_of_zero_and_opacities_of_zero_and_one_stay_finite() -> None:
    old, about = gaussians(), rays()
    old.scales[0], old.opacities[1], old.opacities[2] = 0.0, 0.0, 1.0
    change = zero_change(old, about)
    with torch.no_grad():
        for value in change.values():
            value.add_(0.5)
    new = changed(old, change, about)
    sum(getattr(new, name).sum() for name in ("means", "scales", "opacities", "sh")).backward()
    assert all(bool(value.grad.isfinite().all()) for value in change.values())
    assert torch.equal(new.scales[0], torch.zeros(3))
    nearly_none, nearly_one = new.opacities.detach()[1:3].tolist()
    assert OPACITY_EPS < nearly_none < 2 * OPACITY_EPS and 1 - OPACITY_EPS < nearly_one < 1


def test_gradients_are_those_of_the_formula() -> None:
    old, about = gaussians(dtype=torch.float64), rays(torch.float64)
    names, values = zip(*zero_change(old, about).items(), strict=True)

    def flat(*change: torch.Tensor) -> torch.Tensor:
        new = changed(old, dict(zip(names, change, strict=True)), about)
        return torch.cat(
            [new.means.flatten(), new.scales.flatten(), new.opacities, new.sh[:, 0, 0]]
        )

    shifted = [
        (value + 0.1 * torch.randn_like(value)).detach().requires_grad_() for value in values
    ]
    assert torch.autograd.gradcheck(flat, shifted)


@pytest.mark.parametrize(("frames", "keys"), [(9, [0, 4, 8]), (5, [0, 1, 2, 3, 4]), (1, [0])])
def test_rays_start_at_the_cameras_of_key_frames(frames: int, keys: list[int]) -> None:
    cameras = sliding_path(pinhole(FOCAL_PX, (4, 4)), frames, (0.5, 0.0, 0.0)).cameras
    maps = RawGaussianMaps(
        gaussians=torch.zeros(1, 12, len(keys), 4, 4), tokens=torch.zeros(1, 1, 1, 1, 1)
    )
    index = torch.tensor([0, 16 * len(keys) - 1])
    scene = CanonicalScene(gaussians=gaussians(2), cell_index=index, maps=maps)
    about = cell_rays(scene, cameras)
    assert about.grid == (len(keys), 4, 4)
    torch.testing.assert_close(about.origins, cameras.position[[0, keys[-1]]])
