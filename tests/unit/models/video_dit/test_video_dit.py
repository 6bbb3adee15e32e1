import dataclasses

import pytest
import torch
from oracles_models import randomised
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.video_dit.dit import VideoDiT


@pytest.fixture(scope="module")
def dit() -> VideoDiT:
    torch.manual_seed(0)
    return randomised(VideoDiT(tiny_size())).requires_grad_(False)


def inputs(
    frames: int = 2, rows: int = 4, columns: int = 4, batch: int = 1
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    latent = torch.randn(batch, 4, frames, rows, columns)
    camera = torch.randn(batch, 6, 4 * frames - 3, 8 * rows, 8 * columns)
    return latent, torch.rand(batch, frames), camera, torch.randn(batch, 7, 16)


@pytest.mark.parametrize(("frames", "rows", "columns"), [(1, 2, 2), (2, 4, 4), (3, 2, 6)])
def test_shapes(dit: VideoDiT, frames: int, rows: int, columns: int) -> None:
    latent, level, camera, text = inputs(frames, rows, columns, batch=2)
    assert dit(latent, level, camera, text).shape == latent.shape


def test_fresh_network_answers_zero() -> None:
    assert not VideoDiT(tiny_size())(*inputs()).any()


def test_fresh_blocks_are_the_identity() -> None:
    fresh = VideoDiT(tiny_size())
    torch.nn.init.normal_(fresh.head.weight)
    latent, level, camera, text = inputs()
    full = fresh(latent, level, camera, text)
    fresh.blocks = torch.nn.ModuleList()
    torch.testing.assert_close(full, fresh(latent, level, camera, text), atol=0, rtol=0)
    assert full.abs().max() > 0.1


def test_fresh_camera_adapter_leaves_the_backbone_bit_for_bit(dit: VideoDiT) -> None:
    latent, level, camera, text = inputs()
    weight, bias = (
        dit.camera_adapter.to_tokens.weight.clone(),
        dit.camera_adapter.to_tokens.bias.clone(),
    )
    trained = dit(latent, level, camera, text)
    torch.nn.init.zeros_(dit.camera_adapter.to_tokens.weight)
    torch.nn.init.zeros_(dit.camera_adapter.to_tokens.bias)
    fresh = dit(latent, level, camera, text)
    dit.camera_adapter.to_tokens.weight.copy_(weight)
    dit.camera_adapter.to_tokens.bias.copy_(bias)
    assert torch.equal(fresh, dit(latent, level, None, text))
    assert (trained - fresh).abs().max() > 1e-3


def test_without_text_the_cross_attention_never_runs(dit: VideoDiT) -> None:
    latent, level, camera, text = inputs()
    calls = []
    hooks = [
        module.register_forward_hook(lambda *_: calls.append(1))
        for module in [dit.text_projection, *(block.text_attention for block in dit.blocks)]
    ]
    without = dit(latent, level, camera)
    assert not calls
    given = dit(latent, level, camera, text)
    assert len(calls) == 1 + len(dit.blocks)
    assert (given - without).abs().max() > 1e-3
    for hook in hooks:
        hook.remove()


def test_hidden_text_tokens_do_not_count(dit: VideoDiT) -> None:
    latent, level, camera, text = inputs()
    mask = torch.arange(7)[None] < 3
    masked = dit(latent, level, camera, text, mask)
    torch.testing.assert_close(
        masked, dit(latent, level, camera, text[:, :3]), atol=1e-5, rtol=1e-4
    )


def test_level_is_per_frame(dit: VideoDiT) -> None:
    latent, _, camera, _ = inputs(frames=3)
    blind = [block.attention.to_output for block in dit.blocks]
    saved = [[p.clone() for p in layer.parameters()] for layer in blind]
    for layer in blind:  # without self-attention a frame can only be changed by its own level
        for parameter in layer.parameters():
            parameter.zero_()
    one, other = torch.tensor([[0.0, 0.5, 0.5]]), torch.tensor([[0.0, 0.5, 0.9]])
    moved = (dit(latent, one, camera) - dit(latent, other, camera)).abs().amax((0, 1, 3, 4)) > 1e-6
    for layer, parameters in zip(blind, saved, strict=True):
        for parameter, value in zip(layer.parameters(), parameters, strict=True):
            parameter.copy_(value)
    assert moved.tolist() == [False, False, True]


def test_equal_levels_and_frames_are_treated_alike(dit: VideoDiT) -> None:
    latent, _, camera, text = inputs(batch=2)
    level = torch.tensor([[0.0, 0.3], [0.0, 0.8]])
    both = dit(latent, level, camera, text)
    for item in range(2):
        one = slice(item, item + 1)
        single = dit(latent[one], level[one], camera[one], text[one])
        torch.testing.assert_close(both[one], single, atol=1e-5, rtol=1e-4)


def test_prepared_conditions_give_the_same_velocity(dit: VideoDiT) -> None:
    latent, level, camera, text = inputs()
    prepared = dit.velocity(latent, level, dit.prepare(camera, text))
    torch.testing.assert_close(prepared, dit(latent, level, camera, text), atol=0, rtol=0)


@pytest.mark.parametrize("level", [0.0, 1.0, 1e-12])
@pytest.mark.parametrize("scale", [0.0, 1.0, 1e6])
def test_extremes_stay_finite(dit: VideoDiT, level: float, scale: float) -> None:
    latent, _, camera, text = inputs()
    latent = (latent * scale).requires_grad_()
    out = dit(latent, torch.full((1, 2), level), camera * scale, text)
    out.sum().backward()
    assert torch.isfinite(out).all() and torch.isfinite(latent.grad).all()


def test_gradient_reaches_every_weight() -> None:
    trained = randomised(VideoDiT(tiny_size()))
    trained(*inputs()).square().sum().backward()
    assert all(
        p.grad is not None and p.grad.abs().sum() > 0
        for p in trained.parameters()
        if p.numel() > 24
    )


def test_autocast_stays_near_full_precision(dit: VideoDiT) -> None:
    given = inputs()
    with torch.autocast("cpu", torch.bfloat16):
        low = dit(*given)
    full = dit(*given)
    assert low.dtype == torch.float32
    assert (low - full).norm() / full.norm() < 0.05


def test_odd_latents_are_refused(dit: VideoDiT) -> None:
    latent, level, _, _ = inputs(rows=3)
    with pytest.raises(ShapeError, match="expected a multiple of"):
        dit(latent, level)


def test_latent_channels_come_from_the_configuration() -> None:
    config = tiny_size()
    wide = dataclasses.replace(config, vae=dataclasses.replace(config.vae, latent_channels=6))
    latent = torch.randn(1, 6, 1, 2, 2)
    assert VideoDiT(wide)(latent, torch.rand(1, 1)).shape == latent.shape
