import math

import pytest
import torch

from diff4splat.models.blocks.modulation import ZeroModulation, modulate
from diff4splat.models.blocks.norm import ChannelRmsNorm
from diff4splat.models.blocks.time_embedding import fourier_embedding, level_embedding


def test_channel_norm_follows_the_formula() -> None:
    norm = ChannelRmsNorm(3)
    features = torch.randn(2, 3, 4, 5, 6)
    want = features / (features.square().mean(1, keepdim=True) + 1e-6).sqrt()
    torch.testing.assert_close(norm(features), want)


@pytest.mark.parametrize("scale", [0.0, 1e-30, 1e15])
def test_channel_norm_extremes(scale: float) -> None:
    features = (torch.randn(1, 4, 2, 2) * scale).requires_grad_()
    out = ChannelRmsNorm(4)(features)
    out.sum().backward()
    assert torch.isfinite(out).all() and torch.isfinite(features.grad).all()


def test_channel_norm_survives_outliers_in_half_precision() -> None:
    features = torch.full((1, 4, 2, 2), 1e4, dtype=torch.float16)
    out = ChannelRmsNorm(4).half()(features)
    torch.testing.assert_close(out, torch.ones_like(out))


def test_level_embedding_follows_the_formula() -> None:
    got = level_embedding(torch.tensor([0.25]), 6)[0]
    frequencies = [1000 * 0.25 * 10000 ** (-k / 3) for k in range(3)]
    want = [math.cos(f) for f in frequencies] + [math.sin(f) for f in frequencies]
    torch.testing.assert_close(got, torch.tensor(want), atol=3e-5, rtol=0)


def test_level_embedding_is_float32_even_for_half_levels() -> None:
    with torch.autocast("cpu", torch.bfloat16):
        assert level_embedding(torch.tensor([0.5], dtype=torch.bfloat16), 4).dtype == torch.float32


def test_fourier_embedding_follows_the_formula() -> None:
    got = fourier_embedding(torch.tensor([0.3]), 3)[0]
    angles = [math.pi * 2**k * 0.3 for k in range(3)]
    want = [math.sin(a) for a in angles] + [math.cos(a) for a in angles]
    torch.testing.assert_close(got, torch.tensor(want), atol=1e-6, rtol=0)


def test_octaves_tell_apart_the_ends_of_the_clip() -> None:
    start, stop = fourier_embedding(torch.tensor([0.0, 1.0]), 10)
    assert (start - stop).abs().max() > 1


def test_zero_modulation_changes_nothing() -> None:
    tokens = torch.randn(2, 3, 8)
    shift, scale, gate = ZeroModulation(5, 8, 3)(torch.randn(2, 3, 5)).unbind(-2)
    torch.testing.assert_close(modulate(tokens, shift, scale), tokens, atol=0, rtol=0)
    assert not gate.any()


def test_modulate_follows_the_formula() -> None:
    tokens, shift, scale = torch.randn(2, 3), torch.randn(2, 3), torch.randn(2, 3)
    torch.testing.assert_close(modulate(tokens, shift, scale), tokens + tokens * scale + shift)
