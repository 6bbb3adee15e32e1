import dataclasses

import pytest
import torch
from oracles_models import patches, randomised

from diff4splat.errors import ShapeError
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.ldrm.ldrm import Ldrm


def half_grid() -> Ldrm:
    config = tiny_size()
    return Ldrm(dataclasses.replace(config, ldrm=dataclasses.replace(config.ldrm, grid_stride=2)))


def inputs(frames: int, rows: int = 2, columns: int = 2) -> tuple[torch.Tensor, torch.Tensor]:
    latent = torch.randn(1, 4, 1 + frames // 4, 2 * rows, 2 * columns)
    return latent, torch.randn(1, 6, frames, 16 * rows, 16 * columns)


@pytest.mark.parametrize("frames", [1, 5, 9])
@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 3)])
def test_shapes(frames: int, rows: int, columns: int) -> None:
    maps = Ldrm(tiny_size())(*inputs(frames, rows, columns))
    assert maps.gaussians.shape == (1, 12, frames, 16 * rows, 16 * columns)
    assert maps.tokens.shape == (1, 24, 1 + frames // 4, rows, columns)


@pytest.mark.parametrize("frames", [1, 5])
def test_half_grid(frames: int) -> None:
    maps = half_grid()(*inputs(frames, 1, 2))
    assert maps.gaussians.shape == (1, 12, frames, 8, 16)


def test_fresh_model_answers_exactly_zero_from_live_tokens() -> None:
    maps = Ldrm(tiny_size())(*inputs(5))
    assert not maps.gaussians.any()
    assert maps.tokens.std() > 0.1


def test_trained_model_depends_on_latent_and_rays() -> None:
    trained = randomised(Ldrm(tiny_size()))
    latent, camera = (tensor.requires_grad_() for tensor in inputs(5))
    trained(latent, camera).gaussians.square().sum().backward()
    assert (latent.grad.abs() > 0).all() and (camera.grad.abs() > 0).all()
    assert all(p.grad.abs().sum() > 0 for p in trained.parameters() if p.numel() > 24)


def test_pose_tokens_are_the_strided_convolution() -> None:
    trained = randomised(Ldrm(tiny_size())).requires_grad_(False)
    camera = torch.randn(1, 6, 5, 16, 32)
    filled = torch.cat([camera[:, :, :1]] * 3 + [camera], 2)
    weight = trained.pose_tokens.weight.reshape(24, 6, 4, 16, 16)
    want = torch.nn.functional.conv3d(filled, weight, trained.pose_tokens.bias, stride=(4, 16, 16))
    got = trained._pose_tokens(camera)
    torch.testing.assert_close(got, trained.pose_norm(want.movedim(1, -1)), atol=1e-4, rtol=1e-4)


def test_pose_and_latent_tokens_cover_the_same_frames() -> None:
    trained = randomised(Ldrm(tiny_size())).requires_grad_(False)
    camera = torch.randn(1, 6, 9, 16, 16)
    for frame in range(9):
        other = camera.clone()
        other[:, :, frame] += 1
        moved = (trained._pose_tokens(camera) - trained._pose_tokens(other)).abs().amax(
            (0, 2, 3, 4)
        ) > 0
        assert moved.nonzero().flatten().tolist() == [-(-frame // 4)]


def test_latent_tokens_are_projected_patches() -> None:
    trained = randomised(Ldrm(tiny_size())).requires_grad_(False)
    latent = torch.randn(1, 4, 2, 4, 2)
    embedded = torch.einsum("bcthw,ec->bethw", latent, trained.latent_embedding.weight)
    embedded = embedded + trained.latent_embedding.bias[:, None, None, None]
    want = trained.latent_norm(trained.latent_tokens(patches(embedded, (1, 2, 2))))
    torch.testing.assert_close(trained._latent_tokens(latent), want, atol=1e-5, rtol=1e-4)


def test_each_token_decodes_the_frames_that_its_latent_holds() -> None:
    trained = randomised(Ldrm(tiny_size())).requires_grad_(False)
    trained.blocks, trained.norm_out = torch.nn.ModuleList(), torch.nn.Identity()
    latent, camera = inputs(9)
    plain = trained(latent, camera).gaussians
    latent[:, :, 1] += 1
    moved = (trained(latent, camera).gaussians - plain).abs().amax((0, 1, 3, 4)) > 0
    assert moved.nonzero().flatten().tolist() == [1, 2, 3, 4]


def test_swapping_frames_is_noticed() -> None:
    trained = randomised(Ldrm(tiny_size())).requires_grad_(False)
    latent, camera = inputs(9)
    latent[:, :, 2], camera = latent[:, :, 1], camera[:, :, :1].expand_as(camera)
    tokens = trained(latent, camera).tokens
    assert (tokens[:, :, 1] - tokens[:, :, 2]).abs().max() > 1e-4


@pytest.mark.parametrize("scale", [0.0, 1e6])
def test_extremes_stay_finite(scale: float) -> None:
    trained = randomised(Ldrm(tiny_size()))
    latent, camera = ((tensor * scale).requires_grad_() for tensor in inputs(5))
    out = trained(latent, camera).gaussians
    out.sum().backward()
    assert torch.isfinite(out).all()
    assert torch.isfinite(latent.grad).all() and torch.isfinite(camera.grad).all()


def test_maps_are_full_precision_under_autocast() -> None:
    with torch.autocast("cpu", torch.bfloat16):
        maps = Ldrm(tiny_size())(*inputs(1))
    assert maps.gaussians.dtype == maps.tokens.dtype == torch.float32


def test_rays_of_another_video_are_refused() -> None:
    latent, _ = inputs(5)
    _, camera = inputs(9)
    with pytest.raises(ShapeError, match="expected rays for the latent's token grid"):
        Ldrm(tiny_size())(latent, camera)
