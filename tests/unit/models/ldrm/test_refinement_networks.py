"""Refinement: zero when fresh, no offset at a key frame's time, finite."""

from dataclasses import replace

import pytest
import torch
from depth_priors import DistanceOf
from oracles_models import randomised
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.generation.video.canonical_scene import reconstruct_refined
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.rays import plucker_map
from diff4splat.models.config.model import MonocularDepthConfig, RefinementConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.deformation.refined_network import RefinedDeformation
from diff4splat.models.ldrm.ldrm import Ldrm
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement import motion_features
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, StartDistance
from diff4splat.models.ldrm.refinement.start_distance import with_start_distance
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.gaussians import Gaussians

REFINEMENT = RefinementConfig(channels=6, match_channels=4, cost_volume_depths=4, border_cells=4)
CONFIG = replace(tiny_size(), refinement=REFINEMENT)
ON_PRIOR = replace(
    CONFIG,
    refinement=replace(REFINEMENT, depth_prior=True),
    monocular_depth=MonocularDepthConfig(channels=8),
)


def inputs(frames: int, size: tuple[int, int], batch: int = 1) -> tuple:
    poses = torch.eye(4).repeat(batch, frames, 1, 1)
    poses[..., 0, 3] = 0.1 * torch.arange(frames)
    video = PosedVideo(
        rgb=torch.rand(batch, 3, frames, *size), cameras=pinhole(30.0, size).with_pose(poses)
    )
    latent = torch.randn(batch, 4, 1 + frames // 4, size[0] // 8, size[1] // 8)
    return latent, plucker_map(video.cameras).movedim(1, 2), video


@pytest.mark.parametrize(("frames", "size"), [(1, (32, 48)), (5, (64, 32))])
@pytest.mark.parametrize("source", ["latents", "frames"])
def test_fresh_maps_are_zero_and_of_key_frames(
    frames: int, size: tuple[int, int], source: str
) -> None:
    config = replace(CONFIG, ldrm=replace(CONFIG.ldrm, input=source))
    maps = Ldrm(config)(*inputs(frames, size, 2))
    assert maps.gaussians.shape == (2, 12, 1 + frames // 4, *size)
    assert maps.border.shape == (2, 12, size[0] // 4 + 8, size[1] // 4 + 8)
    assert not maps.gaussians.any() and not maps.border.any()


def start_at(prior: Tensor, change: float = 0.0, confidence: float = 0.5) -> StartDistance:
    full = torch.full_like(prior, confidence)
    return StartDistance(prior=prior, parallax=prior + change, confidence=full)


def test_a_fresh_network_has_the_distance_at_which_key_frames_start() -> None:
    latent, rays, video = inputs(5, (32, 48), 2)
    prior = torch.randn(2, 2, 32, 48)
    maps = Ldrm(ON_PRIOR)(latent, rays, replace(video, start=start_at(prior, 0.25)))
    torch.testing.assert_close(maps.gaussians[:, -1], prior + 0.25)
    assert not maps.gaussians[:, :-1].any()


def test_the_network_decides_how_much_of_the_parallax_it_takes() -> None:
    network, (latent, rays, video) = Ldrm(ON_PRIOR), inputs(5, (32, 48))
    torch.nn.init.constant_(network.refinement.parallax_share.out.bias, -0.75)
    prior = torch.randn(1, 2, 32, 48)
    maps = network(latent, rays, replace(video, start=start_at(prior, 0.4)))
    torch.testing.assert_close(maps.gaussians[:, -1], prior + 0.1)


def test_a_trained_network_sees_where_key_frames_start() -> None:
    network, (latent, rays, video) = randomised(Ldrm(ON_PRIOR)), inputs(5, (32, 32))
    flat = torch.zeros(1, 2, 32, 32)
    starts = [start_at(flat), start_at(flat + 1), start_at(flat, 0.5), start_at(flat, 0.0, 1.0)]
    corrections = [
        network(latent, rays, replace(video, start=one)).gaussians[:, -1] - one.parallax
        for one in starts
    ]
    assert all(bool(one.any()) for one in corrections)
    for other in corrections[1:]:
        assert not torch.allclose(corrections[0], other, atol=1e-3)


def test_no_depth_prior_is_a_plane() -> None:
    network, (latent, rays, video) = randomised(Ldrm(ON_PRIOR)), inputs(5, (32, 32))
    plane = replace(video, start=start_at(torch.zeros(1, 2, 32, 32), 0.0, 0.0))
    maps = [network(latent, rays, one).gaussians for one in (video, plane)]
    assert torch.equal(*maps)


def test_the_depth_prior_sees_every_key_frame_enlarged() -> None:
    *_, video = inputs(5, (32, 48), 2)
    seen = []
    prior = DistanceOf(lambda image: seen.append(image) or image.mean(1, keepdim=True))
    found = with_start_distance(video, prior, ON_PRIOR)
    (image,) = seen
    assert image.shape == (4, 3, 64, 64)  # multiples of 32
    assert image.min() >= 0 and image.max() <= 1
    assert found.start.prior.shape == (2, 2, 32, 48)
    want = video.key_rgb.mean(2)
    assert float((found.start.prior - want).abs().mean()) < 0.1
    assert bool((found.start.parallax != found.start.prior).any())
    assert with_start_distance(video, None, ON_PRIOR) is video
    assert with_start_distance(video, prior, CONFIG) is video
    second = found.sample(1)
    assert torch.equal(second.start.parallax, found.start.parallax[1:])


def test_nothing_moves_at_the_time_of_its_key_frame() -> None:
    maps = randomised(Ldrm(CONFIG))(*inputs(5, (32, 48)))
    network = randomised(RefinedDeformation(CONFIG))
    for time, key in ((0.0, 0), (1.0, 1)):
        raw = network(maps.tokens, torch.tensor([time]))
        assert raw.shape == (1, 10, 2, 32, 48)
        assert not raw[:, :, key].any() and bool(raw[:, :, 1 - key].any())


def gaussians(maps: RawGaussianMaps, video: PosedVideo) -> Gaussians:
    return reconstruct_refined(maps, video, CONFIG.activation, RunLog()).gaussians


@pytest.mark.parametrize("change", [{"cost_volume_depths": 0}, {"border_cells": 0}])
def test_the_cost_volume_and_the_border_can_be_left_out(change: dict[str, int]) -> None:
    config = replace(CONFIG, refinement=replace(REFINEMENT, **change))
    maps = randomised(Ldrm(config))(*inputs(5, (32, 32)))
    assert maps.gaussians.shape == (1, 12, 2, 32, 32) and bool(maps.gaussians.isfinite().all())
    assert (maps.border is None) == ("border_cells" in change)


def test_a_static_video_needs_no_optical_flow(monkeypatch: pytest.MonkeyPatch) -> None:
    network, given = randomised(Ldrm(CONFIG)), inputs(5, (32, 32))
    moving = network(*given)
    monkeypatch.delattr(motion_features, "warped_flow")
    static = network(*given, moving=False)
    assert torch.equal(static.gaussians, moving.gaussians)
    assert static.tokens.shape[1] == moving.tokens.shape[1] - motion_features.MOTION_CHANNELS


def test_gradients_and_extreme_maps_are_finite() -> None:
    *rest, video = inputs(5, (32, 32))
    network = randomised(Ldrm(CONFIG))
    maps = network(*rest, video)
    extreme = replace(maps, gaussians=maps.gaussians * 0 + 1e4)
    for some in (maps, extreme):
        found = gaussians(some, video)
        assert bool(found.means.isfinite().all()) and bool(found.scales.isfinite().all())
    found = gaussians(maps, video)
    (found.means.sum() + found.scales.sum()).backward()
    assert all(bool(p.grad.isfinite().all()) for p in network.parameters() if p.grad is not None)


def test_a_missing_video_is_refused() -> None:
    latent, rays, _ = inputs(1, (32, 32))
    with pytest.raises(ShapeError, match="expected frames with their cameras"):
        Ldrm(CONFIG)(latent, rays)
