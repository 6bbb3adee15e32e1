import math

import numpy as np
import oracles_losses as oracle
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ShapeError
from diff4splat.training.losses.depth import (
    FLATTEST,
    depth_correlation,
    depth_log_error,
    depth_smoothness,
)

F64 = torch.float64


def depths(*shape: int, dtype: torch.dtype = F64) -> torch.Tensor:
    return torch.rand(*shape, dtype=dtype) * 4 + 1


def value_and_gradient(function, depth: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    depth = depth.detach().clone().requires_grad_()
    loss = function(depth)
    loss.sum().backward()
    assert loss.isfinite().all()
    assert depth.grad.isfinite().all()
    return loss.detach(), depth.grad


def test_correlation_against_numpy() -> None:
    rendered, truth = depths(2, 3, 5, 6), depths(2, 3, 5, 6)
    valid = torch.rand(2, 3, 5, 6) < 0.8
    expected = [
        np.mean(
            [
                oracle.correlation_loss(rendered[b, k].numpy(), truth[b, k].numpy(), valid[b, k])
                for k in range(3)
            ]
        )
        for b in range(2)
    ]
    np.testing.assert_allclose(depth_correlation(rendered, truth, valid), expected, rtol=1e-10)


@settings(max_examples=25, deadline=None)
@given(scale=st.floats(1e-4, 1e6), share=st.floats(-0.5, 10))
def test_scale_and_shift_do_not_matter(scale: float, share: float) -> None:
    truth = depths(1, 2, 4, 5)
    loss = depth_correlation(scale * (truth + share), truth)
    torch.testing.assert_close(loss, torch.zeros(1, dtype=F64), rtol=0, atol=1e-9)
    turned = depth_correlation(scale * (20 - truth), truth)
    torch.testing.assert_close(turned, torch.full((1,), 2.0, dtype=F64))


def test_zero_depth_is_not_truth() -> None:
    rendered, truth = depths(1, 1, 6, 6), depths(1, 1, 6, 6)
    truth[..., 0] = 0
    truth[..., 1] = float("nan")
    valid = torch.ones_like(truth, dtype=torch.bool)
    valid[..., :2] = False
    loss, gradient = value_and_gradient(lambda d: depth_correlation(d, truth), rendered)
    torch.testing.assert_close(loss, depth_correlation(rendered, truth, valid))
    assert not gradient[..., :2].any()


def test_a_map_without_a_statement_is_left_out() -> None:
    rendered, truth = depths(1, 3, 5, 5), depths(1, 3, 5, 5)
    alone = depth_correlation(rendered[:, :1], truth[:, :1])
    truth[:, 1] = 3.0
    truth[:, 2, 1:] = 0
    loss, gradient = value_and_gradient(lambda d: depth_correlation(d, truth), rendered)
    torch.testing.assert_close(loss, alone)
    assert not gradient[:, 1:].any()


@pytest.mark.parametrize("height", [0, 1, 5])
def test_nothing_usable_gives_zero(height: int) -> None:
    truth = torch.zeros(2, 2, height, 5)
    loss, gradient = value_and_gradient(
        lambda d: depth_correlation(d, truth), depths(2, 2, height, 5, dtype=torch.float32)
    )
    assert loss.tolist() == [0, 0]
    assert not gradient.any()


def test_a_rendered_plane_learns_to_leave_it() -> None:
    truth = depths(1, 1, 8, 8)
    plane = torch.full_like(truth, 2.0)
    loss, gradient = value_and_gradient(lambda d: depth_correlation(d, truth), plane)
    assert float(loss) == 1
    assert float(gradient.norm()) == pytest.approx(1 / (8 * 2.0 * FLATTEST))
    assert depth_correlation(plane - 1e-4 * gradient, truth) < 1


@pytest.mark.parametrize("fill", [0.0, 1e-30, 1e30])
def test_extreme_renders_stay_finite(fill: float) -> None:
    truth = depths(1, 1, 6, 6, dtype=torch.float32)
    flat = torch.full_like(truth, fill)
    value_and_gradient(lambda d: depth_correlation(d, truth), flat)
    loss, _ = value_and_gradient(lambda d: depth_correlation(d, 1e25 * truth), 1e-30 * truth)
    assert 0 <= float(loss) <= 1
    loss, _ = value_and_gradient(lambda d: depth_correlation(d, truth), 1e30 * truth)
    assert float(loss) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_half_precision_is_widened(dtype: torch.dtype) -> None:
    rendered, truth = depths(1, 1, 64, 64).to(dtype), depths(1, 1, 64, 64).to(dtype)
    loss = depth_correlation(rendered, truth)
    assert loss.dtype == torch.float32
    torch.testing.assert_close(
        loss, depth_correlation(rendered.double(), truth.double()).float(), rtol=1e-5, atol=1e-6
    )
    assert depth_smoothness(rendered).dtype == torch.float32


def test_correlation_gradient() -> None:
    rendered, truth = depths(1, 2, 4, 5).requires_grad_(), depths(1, 2, 4, 5)
    valid = torch.rand(1, 2, 4, 5) < 0.9
    assert torch.autograd.gradcheck(lambda d: depth_correlation(d, truth, valid), rendered)


def test_smoothness_against_loops() -> None:
    depth, valid = depths(2, 3, 5, 4), torch.rand(2, 3, 5, 4) < 0.7
    expected = [oracle.smoothness(depth[b].numpy(), valid[b].numpy()) for b in range(2)]
    np.testing.assert_allclose(depth_smoothness(depth, valid), expected, rtol=1e-12)


@settings(max_examples=25, deadline=None)
@given(scale=st.floats(1e-4, 1e6))
def test_smoothness_does_not_depend_on_the_unit(scale: float) -> None:
    depth = depths(1, 1, 4, 4)
    torch.testing.assert_close(depth_smoothness(scale * depth), depth_smoothness(depth))


def test_smoothness_does_not_pull_towards_the_camera() -> None:
    depth = depths(1, 1, 4, 4)
    _, gradient = value_and_gradient(depth_smoothness, depth)
    assert float((gradient * depth).sum()) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("depth", [torch.zeros(1, 1, 3, 3), torch.full((1, 2, 1, 1), 5.0)])
def test_a_plane_is_smooth(depth: torch.Tensor) -> None:
    loss, gradient = value_and_gradient(depth_smoothness, depth)
    assert float(loss) == 0
    assert not gradient.any()


def test_invalid_pixels_are_no_neighbours() -> None:
    depth = torch.ones(1, 1, 2, 3)
    depth[..., 1] = float("nan")
    loss, gradient = value_and_gradient(lambda d: depth_smoothness(d, d.isfinite()), depth)
    assert float(loss) == 0
    assert not gradient.any()


def test_smoothness_gradient() -> None:
    depth = depths(1, 2, 3, 4).requires_grad_()
    valid = torch.rand(1, 2, 3, 4) < 0.8
    assert torch.autograd.gradcheck(lambda d: depth_smoothness(d, valid), depth)


@pytest.mark.usefixtures("as_shipped")
def test_shapes_must_agree() -> None:
    one, two = torch.ones(1, 1, 2, 2), torch.ones(2, 1, 2, 2)
    with pytest.raises(ShapeError, match=r"rendered: expected \(2, 1, 2, 2\), got \(1, 1"):
        depth_correlation(one, two)
    with pytest.raises(ShapeError, match=r"valid: expected \(1, 1, 2, 2\) bool, got .* float32"):
        depth_correlation(one, one, one)
    with pytest.raises(ShapeError, match=r"valid: expected \(1, 1, 2, 2\) bool, got \(2, 1"):
        depth_smoothness(one, two.bool())


def test_log_error_is_the_mean_over_known_pixels() -> None:
    depth = torch.tensor([[[[1.0, 2.0], [3.0, 5.0]]]], dtype=torch.float64)
    truth = torch.tensor([[[[2.0, 2.0], [0.0, torch.inf]]]], dtype=torch.float64)
    torch.testing.assert_close(
        depth_log_error(depth, truth), torch.tensor([math.log(2) / 2], dtype=torch.float64)
    )


def test_log_error_without_truth_is_zero_with_a_zero_gradient() -> None:
    depth = torch.ones(2, 1, 2, 2, requires_grad=True)
    error = depth_log_error(depth, torch.zeros(2, 1, 2, 2))
    error.sum().backward()
    assert not error.any() and not depth.grad.any()


def test_log_error_has_the_right_gradient() -> None:
    depth = torch.rand(1, 2, 3, 3, dtype=torch.float64) + 1
    truth = torch.rand(1, 2, 3, 3, dtype=torch.float64) + 3
    assert torch.autograd.gradcheck(
        lambda one: depth_log_error(one, truth), depth.requires_grad_(True)
    )
