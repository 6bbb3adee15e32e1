import math

import numpy as np
import oracles_losses as oracle
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ShapeError
from diff4splat.training.losses.motion import track_motion

F64 = torch.float64


@pytest.mark.parametrize("weights", [(2.0, 1.0), (2.0, 0.0), (0.5, 3.0)])
def test_motion_against_loops(weights: tuple[float, float]) -> None:
    predicted, truth = torch.randn(2, 2, 3, 4, 3, dtype=F64)
    valid = torch.rand(2, 3, 4) < 0.7
    loss = track_motion(predicted, truth, valid, distance_weight=weights[0], l1_weight=weights[1])
    expected = [
        oracle.motion(predicted[b].numpy(), truth[b].numpy(), valid[b].numpy(), *weights)
        for b in range(2)
    ]
    np.testing.assert_allclose(loss, expected, rtol=1e-12)


def test_the_paper_is_the_default() -> None:
    predicted, truth = torch.tensor([[[3.0, -4.0, 0.0]]]), torch.zeros(1, 1, 3)
    assert float(track_motion(predicted, truth)) == 2 * 5 + 7


@settings(max_examples=25, deadline=None)
@given(scale=st.floats(0, 1e6), seed=st.integers(0, 99))
def test_the_loss_grows_with_the_unit(scale: float, seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    predicted, truth = torch.randn(2, 1, 5, 3, dtype=F64, generator=generator)
    torch.testing.assert_close(
        track_motion(scale * predicted, scale * truth), scale * track_motion(predicted, truth)
    )


def test_standing_still_as_it_should_has_no_gradient() -> None:
    predicted = torch.zeros(2, 5, 3, requires_grad=True)
    loss = track_motion(predicted, torch.zeros(2, 5, 3))
    loss.sum().backward()
    assert loss.tolist() == [0, 0]
    assert not predicted.grad.any()


def test_the_size_term_pulls_to_standstill_and_can_be_switched_off() -> None:
    truth = torch.tensor([[[1.0, 0.0, 0.0]]])
    for l1_weight, expected in ((1.0, [1.0, 0.0, 0.0]), (0.0, [0.0, 0.0, 0.0])):
        predicted = truth.clone().requires_grad_()
        track_motion(predicted, truth, l1_weight=l1_weight).sum().backward()
        assert predicted.grad[0, 0].tolist() == expected


@pytest.mark.parametrize("points", [0, 3])
def test_no_tracks_cost_nothing(points: int) -> None:
    predicted = torch.randn(2, points, 3, requires_grad=True)
    truth = torch.full((2, points, 3), float("nan"))
    loss = track_motion(predicted, truth, torch.zeros(2, points, dtype=torch.bool))
    loss.sum().backward()
    assert loss.tolist() == [0, 0]
    assert not predicted.grad.any()


@pytest.mark.parametrize("size", [1e-30, 1e-3, 1e8])
@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_extreme_motions_stay_finite(size: float, dtype: torch.dtype) -> None:
    predicted = (size * torch.randn(1, 4, 3)).to(dtype).requires_grad_()
    truth = (size * torch.randn(1, 4, 3)).to(dtype)
    loss = track_motion(predicted, truth)
    loss.sum().backward()
    assert loss.dtype == torch.float32
    assert loss.isfinite().all()
    assert predicted.grad.isfinite().all()


def test_gradients() -> None:
    predicted, truth = torch.randn(2, 2, 4, 3, dtype=F64)
    valid = torch.tensor([[True, True, False, True]] * 2)
    predicted.requires_grad_()
    assert torch.autograd.gradcheck(lambda p: track_motion(p, truth, valid), predicted)


@pytest.mark.usefixtures("as_shipped")
def test_shapes_must_agree() -> None:
    one, two = torch.zeros(1, 2, 3), torch.zeros(2, 2, 3)
    with pytest.raises(ShapeError, match=r"predicted: expected \(2, 2, 3\), got \(1, 2, 3\)"):
        track_motion(one, two)
    with pytest.raises(ShapeError, match=r"valid: expected \(1, 2\) bool, got \(2, 2\) bool"):
        track_motion(one, one, torch.ones(2, 2, dtype=torch.bool))


def test_a_width_rounds_the_distance_off_near_zero() -> None:
    truth = torch.zeros(1, 3, 3, dtype=torch.float64)
    predicted = torch.tensor([[[0.0, 0, 0], [0.3, 0.4, 0], [30.0, 40, 0]]], dtype=torch.float64)
    want = sum(math.hypot(d, 1.2) - 1.2 for d in (0.0, 0.5, 50.0)) / 3
    loss = track_motion(predicted, truth, distance_weight=1.0, l1_weight=0.0, huber_delta=1.2)
    torch.testing.assert_close(loss, torch.tensor([want], dtype=torch.float64))


def test_a_width_has_the_right_gradient_and_none_where_both_agree() -> None:
    truth = torch.rand(1, 4, 3, dtype=torch.float64)
    predicted = (truth + 0.3).requires_grad_()
    assert torch.autograd.gradcheck(lambda p: track_motion(p, truth, huber_delta=0.2), predicted)
    same = truth.clone().requires_grad_()
    track_motion(same, truth, l1_weight=0.0, huber_delta=0.2).sum().backward()
    assert not same.grad.any()
