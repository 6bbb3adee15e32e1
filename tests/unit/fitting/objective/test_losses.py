"""What does not count has no part in a loss, in value or gradient."""

import pytest
import torch
from small_fits import with_flow

from diff4splat.data.capture.capture import Frame
from diff4splat.fitting.objective.losses import (
    color_loss,
    depth_loss,
    flow_loss,
    image_loss,
)
from diff4splat.fitting.settings import LossWeights
from diff4splat.render.settings import RenderOutput

GENERATOR = torch.Generator().manual_seed(3)
RGB = torch.rand(16, 20, 3, generator=GENERATOR)
OTHER = torch.rand(16, 20, 3, generator=GENERATOR)


def test_color_is_the_mean_absolute_error():
    assert float(color_loss(RGB, OTHER, None)) == pytest.approx(
        float((RGB - OTHER).abs().mean()), rel=1e-6
    )


@pytest.mark.parametrize("ssim", [0.0, 0.2])
def test_masked_pixels_have_no_gradient(ssim: float):
    counts = torch.zeros(16, 20, dtype=torch.bool)
    counts[:, :9] = True
    made = RGB.clone().requires_grad_()
    frame = Frame(rgb=OTHER, counts=counts)
    image_loss(RenderOutput(rgb=made), frame, LossWeights(ssim=ssim)).backward()
    assert made.grad[:, :9].abs().sum() > 0
    assert not made.grad[:, 9:].any()


def test_a_mask_over_everything_gives_nothing_and_stays_finite():
    made = RGB.clone().requires_grad_()
    frame = Frame(rgb=OTHER, counts=torch.zeros(16, 20, dtype=torch.bool))
    loss = image_loss(RenderOutput(rgb=made), frame, LossWeights(ssim=0.2))
    loss.backward()
    assert float(loss.detach()) == pytest.approx(0.0, abs=1e-6)
    assert not made.grad.any()


def test_depth_compares_disparities_where_both_are_known():
    depth = torch.tensor([[2.0, 4.0, 0.0, 5.0]])
    truth = torch.tensor([[1.0, 4.0, 3.0, 0.0]])
    expected = (abs(0.5 - 1.0) + 0) / 2 / ((1.0 + 0.25) / 2)
    assert float(depth_loss(depth, truth, None)) == pytest.approx(expected)
    nothing = torch.zeros(1, 4, requires_grad=True)
    depth_loss(nothing, truth, None).backward()
    assert not nothing.grad.any()


def test_flow_is_the_end_point_error_in_image_widths():
    frame = with_flow(Frame(rgb=RGB), 1, torch.tensor([3.0, 4.0]))
    made = torch.zeros(16, 20, 2, requires_grad=True)
    loss = flow_loss(made, frame.flow)
    assert float(loss.detach()) == pytest.approx(5 / 20, rel=1e-5)
    loss.backward()
    assert bool(torch.isfinite(made.grad).all())
    exact = frame.flow.offset_px.clone().requires_grad_()
    flow_loss(exact, frame.flow).backward()
    assert bool(torch.isfinite(exact.grad).all())
