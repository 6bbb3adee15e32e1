import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ConfigError
from diff4splat.training.losses.mean_velocity import mean_velocity, segment_of

F64 = torch.float64
LEVEL, END = torch.tensor([1.0, 0.6], dtype=F64), torch.tensor([0.5, 0.35], dtype=F64)


def decay(state: torch.Tensor, level: torch.Tensor) -> torch.Tensor:
    """Whose flow is known: x(l) = x e^(l - l0)."""
    del level
    return state


def test_against_the_integral_in_closed_form() -> None:
    state = torch.randn(2, 3, 4, dtype=F64)
    length = (LEVEL - END)[:, None, None]
    exact = state * (1 - (-length).exp()) / length
    errors = [
        (mean_velocity(decay, state, LEVEL, END, steps) - exact).abs().max().item()
        for steps in (10, 100, 1000)
    ]
    assert errors[2] < 5e-4
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.1)


def test_euler_steps_by_hand() -> None:
    """Velocity state · level, two steps from 1 to 0.5."""
    state = torch.tensor([[2.0]], dtype=F64)
    first = 2.0 * 1.0
    second = (2.0 - 0.25 * first) * 0.75
    found = mean_velocity(lambda x, level: x * level[:, None], state, LEVEL[:1], END[:1], 2)
    assert found.item() == pytest.approx((first + second) / 2, abs=1e-15)


def test_one_euler_step_with_it_goes_where_the_small_ones_go() -> None:
    state = torch.randn(2, 5, dtype=F64)
    mean = mean_velocity(decay, state, LEVEL, END, 7)
    reached = state - (LEVEL - END)[:, None] * mean
    torch.testing.assert_close(reached, state * (1 - (LEVEL - END)[:, None] / 7) ** 7)


@settings(max_examples=20, deadline=None)
@given(level=st.floats(0, 1), steps=st.integers(1, 9), size=st.floats(1e-6, 1e6))
def test_at_equal_levels_it_is_the_velocity(level: float, steps: int, size: float) -> None:
    state = size * torch.randn(2, 3, dtype=F64)
    here = torch.full((2,), level, dtype=F64)
    found = mean_velocity(decay, state, here, here, steps)
    torch.testing.assert_close(found, state, rtol=1e-12, atol=0)


def test_gradients_in_float64() -> None:
    state = torch.randn(2, 3, dtype=F64, requires_grad=True)
    weight = torch.randn(3, 3, dtype=F64, requires_grad=True)

    def moved(state: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
        def field(x: torch.Tensor, level: torch.Tensor) -> torch.Tensor:
            return torch.tanh(x @ weight) * (1 + level[:, None])

        return mean_velocity(field, state, LEVEL, END, 3)

    assert torch.autograd.gradcheck(moved, (state, weight))


@pytest.mark.parametrize("segments", [1, 3, 4, 25])
def test_segments_are_equal_parts_of_all_levels(segments: int) -> None:
    uniform = torch.linspace(0, 1, 200, dtype=F64)
    start, end = segment_of(uniform, segments)
    torch.testing.assert_close(start - end, torch.full_like(start, 1 / segments))
    assert start.max() == 1 and end.min() == 0
    assert len(start.unique()) == segments
    inside = (uniform >= end - 1e-12) & (uniform <= start + 1e-12)
    assert bool(inside.all())


def test_no_step_is_refused() -> None:
    with pytest.raises(ConfigError, match="at least 1 step, got 0"):
        mean_velocity(decay, torch.zeros(1, 1), torch.ones(1), torch.zeros(1), 0)
