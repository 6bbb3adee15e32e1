"""Blending at peaks beside the exact integral over volumes, which knows no order."""

import pytest
import torch
from oracles_volumes import Segment, integrate

from diff4splat.render.trace.api import trace
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import DEGREE_ZERO

OVERLAPPING = (Segment(1, 3, 0.8, 1.0), Segment(2, 4, 1.5, 0.2))
APART = (Segment(1, 2, 0.8, 1.0), Segment(2, 3.5, 1.5, 0.2), Segment(4, 5, 0.3, 0.6))


def test_the_integral_of_two_overlapping_segments() -> None:
    color, light = integrate(OVERLAPPING)
    assert color == pytest.approx(0.75102, abs=5e-6)
    assert light == pytest.approx(0.010052, abs=5e-7)
    assert integrate(OVERLAPPING[::-1]) == pytest.approx((color, light), abs=1e-15)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_overlapping_gaussians_are_blended_as_points(dtype: torch.dtype) -> None:
    seen = blended(OVERLAPPING, dtype)
    first, second = OVERLAPPING
    expected = first.alpha * first.color + (1 - first.alpha) * second.alpha * second.color
    assert expected == pytest.approx(0.836, abs=5e-4)
    assert seen[0] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_gaussians_apart_give_the_integral(dtype: torch.dtype) -> None:
    color, light = integrate(APART)
    assert blended(APART, dtype) == pytest.approx((color, 1 - light), abs=1e-6)
    assert blended(APART[::-1], dtype) == pytest.approx((color, 1 - light), abs=1e-6)


def blended(segments: tuple[Segment, ...], dtype: torch.dtype) -> tuple[float, float]:
    """Colour and alpha of a ray through the middles of Gaussians as opaque as the segments."""
    middles = torch.tensor([0.5 * (part.entry + part.exit) for part in segments], dtype=dtype)
    colors = torch.tensor([part.color for part in segments], dtype=dtype)
    count = len(segments)
    gaussians = Gaussians(
        means=torch.nn.functional.pad(middles[:, None], (2, 0)),
        quats=torch.tensor([[1.0, 0, 0, 0]], dtype=dtype).repeat(count, 1),
        scales=torch.full((count, 3), 0.1, dtype=dtype),
        opacities=torch.tensor([part.alpha for part in segments], dtype=dtype),
        sh=((colors - 0.5) / DEGREE_ZERO)[:, None, None].repeat(1, 1, 3),
    )
    zero, ahead = torch.zeros(1, 3, dtype=dtype), torch.tensor([[0.0, 0, 1]], dtype=dtype)
    rays = Rays(origins=zero, directions=ahead)
    seen = trace(gaussians, rays, outputs=("rgb", "alpha"), settings=TraceSettings(alpha_max=0.999))
    return float(seen.rgb[0, 0]), float(seen.alpha[0])
