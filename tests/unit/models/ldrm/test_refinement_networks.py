"""The detail decoder's networks: zero when fresh, exact at a Gaussian's own time, finite."""

from dataclasses import replace

import pytest
import torch
from oracles_models import randomised

from diff4splat.errors import ShapeError
from diff4splat.generation.keyframe_gaussians import canonical_gaussians
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.rays import plucker_map
from diff4splat.models.config.model import DetailConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.deformation.refined_network import RefinedDeformation
from diff4splat.models.ldrm.ldrm import Ldrm
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo

DETAIL = DetailConfig(width=6, match_channels=4, depths=4, surroundings=4)
CONFIG = replace(tiny_size(), detail=DETAIL)


def inputs(frames: int, size: tuple[int, int], batch: int = 1) -> tuple:
    poses = torch.eye(4).repeat(batch, frames, 1, 1)
    poses[..., 0, 3] = 0.1 * torch.arange(frames)
    sight = PosedVideo(
        rgb=torch.rand(batch, 3, frames, *size), cameras=pinhole(30.0, size).with_pose(poses)
    )
    latent = torch.randn(batch, 4, 1 + frames // 4, size[0] // 8, size[1] // 8)
    return latent, plucker_map(sight.cameras).movedim(1, 2), sight


@pytest.mark.parametrize(("frames", "size"), [(1, (32, 48)), (5, (64, 32))])
@pytest.mark.parametrize("reads", ["latents", "frames"])
def test_fresh_maps_are_zero_and_of_key_frames(
    frames: int, size: tuple[int, int], reads: str
) -> None:
    config = replace(CONFIG, ldrm=replace(CONFIG.ldrm, reads=reads))
    maps = Ldrm(config)(*inputs(frames, size, 2))
    assert maps.gaussians.shape == (2, 12, 1 + frames // 4, *size)
    assert maps.surroundings.shape == (2, 12, size[0] // 4 + 8, size[1] // 4 + 8)
    assert not maps.gaussians.any() and not maps.surroundings.any()


def test_nothing_moves_at_its_own_time() -> None:
    maps = randomised(Ldrm(CONFIG))(*inputs(5, (32, 48)))
    network = randomised(RefinedDeformation(CONFIG))
    for time, key in ((0.0, 0), (1.0, 1)):
        raw = network(maps.tokens, torch.tensor([time]))
        assert raw.shape == (1, 10, 2, 32, 48)
        assert not raw[:, :, key].any() and bool(raw[:, :, 1 - key].any())


def test_gradients_and_extreme_maps_are_finite() -> None:
    *rest, sight = inputs(5, (32, 32))
    network = randomised(Ldrm(CONFIG))
    maps = network(*rest, sight)
    extreme = replace(maps, gaussians=maps.gaussians * 0 + 1e4)
    for some in (maps, extreme):
        found = canonical_gaussians(some, sight, CONFIG.activation).gaussians
        assert bool(found.means.isfinite().all()) and bool(found.scales.isfinite().all())
    found = canonical_gaussians(maps, sight, CONFIG.activation).gaussians
    (found.means.sum() + found.scales.sum()).backward()
    assert all(bool(p.grad.isfinite().all()) for p in network.parameters() if p.grad is not None)


def test_a_missing_sight_is_refused() -> None:
    latent, rays, _ = inputs(1, (32, 32))
    with pytest.raises(ShapeError, match="expected decoded pictures with their cameras"):
        Ldrm(CONFIG)(latent, rays)
