"""Half precision is widened where it must be, and float64 stays float64 throughout."""

import math

import pytest
import torch

from diff4splat.geometry.camera import pinhole
from diff4splat.models.blocks.precision import at_least_float32
from diff4splat.models.blocks.time_embedding import fourier_embedding, level_embedding
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.ldrm.refinement.warped_flow import warped_flow
from diff4splat.models.ldrm.refinement.warping import sampled
from diff4splat.models.video_dit.conditions import RenderCondition
from diff4splat.models.video_dit.render_condition import RenderConditionEmbedding

WIDENED = {
    torch.bfloat16: torch.float32,
    torch.float16: torch.float32,
    torch.float32: torch.float32,
    torch.float64: torch.float64,
}


@pytest.mark.parametrize("dtype", WIDENED)
def test_half_precision_is_widened(dtype: torch.dtype) -> None:
    assert at_least_float32(torch.ones(2, dtype=dtype)).dtype == WIDENED[dtype]


def test_float64_levels_have_float64_angles() -> None:
    level = torch.tensor([0.7], dtype=torch.float64)
    want = [math.cos(700 * 10000 ** (-k / 4)) for k in range(4)]
    got = level_embedding(level, 8)[0, :4]
    torch.testing.assert_close(got, torch.tensor(want, dtype=torch.float64), atol=1e-12, rtol=0)
    time = fourier_embedding(torch.tensor([0.3], dtype=torch.float64), 4)[0, :4]
    want = [math.sin(math.pi * 2**k * 0.3) for k in range(4)]
    torch.testing.assert_close(time, torch.tensor(want, dtype=torch.float64), atol=1e-14, rtol=0)


@pytest.mark.parametrize("dtype", [torch.bfloat16, torch.float16])
def test_a_render_condition_in_half_precision(dtype: torch.dtype) -> None:
    torch.manual_seed(0)
    network = RenderConditionEmbedding(2, 8)
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter)
    latent, validity = torch.randn(1, 2, 2, 4, 4), torch.rand(1, 1, 5, 16, 16)
    want = network(RenderCondition(latent=latent, validity=validity))
    half = RenderCondition(latent=latent.to(dtype), validity=validity.to(dtype))
    got = network.to(dtype)(half)
    assert got.dtype == dtype
    torch.testing.assert_close(got.float(), want, atol=0.1, rtol=0.05)


@pytest.mark.parametrize("dtype", [torch.bfloat16, torch.float16])
def test_features_in_half_precision_are_sampled_at_float32_pixels(dtype: torch.dtype) -> None:
    features = torch.arange(64.0).view(1, 1, 8, 8)
    pixels = 1.6 * torch.rand(1, 2, 3, 3, 2, generator=torch.Generator().manual_seed(0)) - 0.8
    got = sampled(features.to(dtype), pixels)
    assert got.dtype == dtype
    # 0 to 63 are exact in half precision; only the result is rounded.
    torch.testing.assert_close(got, sampled(features, pixels).to(dtype), atol=0, rtol=0)


@pytest.mark.parametrize("dtype", WIDENED)
def test_optical_flow_in_any_precision(dtype: torch.dtype) -> None:
    generator = torch.Generator().manual_seed(0)
    rgb = torch.rand(1, 3, 5, 16, 16, generator=generator)
    camera = pinhole(16.0, (16, 16), WIDENED[dtype])
    posed = PosedVideo(
        rgb=rgb.to(dtype), cameras=camera.with_pose(camera.world_from_camera.expand(1, 5, 4, 4))
    )
    depth = torch.full((1, 2, 16, 16), 4.0, dtype=WIDENED[dtype])
    slots = warped_flow(depth, posed)
    assert slots.dtype == WIDENED[dtype]
    assert bool(torch.isfinite(slots).all())
