import math
from collections.abc import Callable

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.models.ldrm import activations

LIMIT = math.log(16)
EXTREMES = [0.0, 1e-30, -1e-3, 1.0, -1.0, 80.0, 1e3, -1e3, 1e4, -1e4, 3e38, -3e38]
LAWS: dict[str, tuple[int, Callable[[Tensor], Tensor]]] = {
    "log ratio": (3, lambda raw: activations.log_ratio(raw, LIMIT)),
    "bounded factor": (3, lambda raw: activations.bounded_factor(raw, LIMIT)),
    "rotation": (4, activations.rotation),
    "opacity": (3, lambda raw: activations.opacity(raw, torch.full_like(raw, 0.3))),
    "color": (3, lambda raw: activations.color(raw, torch.full_like(raw, 0.7))),
    "stretch": (
        3,
        lambda raw: activations.stretch(
            raw, raw.new_tensor([0.5, -2.0, 9.0]).expand_as(raw), LIMIT
        ),
    ),
}


@pytest.mark.parametrize("name", LAWS)
def test_gradcheck(name: str) -> None:
    width, law = LAWS[name]
    raw = torch.randn(5, width, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(law, raw)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_extreme_raw_values_have_finite_values_and_gradients(name: str, dtype: torch.dtype) -> None:
    width, law = LAWS[name]
    raw = torch.tensor(EXTREMES, dtype=dtype)[:, None].repeat(1, width).requires_grad_()
    out = law(raw)
    out.sum().backward()
    assert torch.isfinite(out).all() and torch.isfinite(raw.grad).all()


@pytest.mark.parametrize("name", LAWS)
def test_half_precision_is_refused(name: str) -> None:
    width, law = LAWS[name]
    message = r"expected float32 or float64, got torch\.\w*16; convert"
    for dtype in (torch.float16, torch.bfloat16):
        with pytest.raises(ShapeError, match=message):
            law(torch.zeros(2, width, dtype=dtype))


@given(base=st.floats(0, 1, width=32))
@settings(max_examples=25, deadline=None)
def test_zero_is_exactly_the_base(base: float) -> None:
    bases, zero = torch.full((1, 3), base), torch.zeros(1, 3)
    assert torch.equal(activations.opacity(zero, bases), bases)
    assert torch.equal(activations.color(zero, bases), bases)
    assert torch.equal(activations.bounded_factor(zero, LIMIT), torch.ones(1, 3))
    assert torch.equal(activations.rotation(torch.zeros(1, 4)), torch.tensor([[1.0, 0, 0, 0]]))
    assert not activations.stretch(zero, 20 * bases, LIMIT).any()


def slope(law: Callable[[Tensor], Tensor], at: float = 0.0) -> float:
    raw = torch.tensor([at], dtype=torch.float64, requires_grad=True)
    return float(torch.autograd.grad(law(raw).sum(), raw)[0])


def test_slopes_at_zero() -> None:
    assert slope(lambda raw: activations.log_ratio(raw, LIMIT)) == pytest.approx(1)
    assert slope(
        lambda raw: activations.color(raw.expand(1, 3), torch.zeros(1, 3).double())[:, :1]
    ) == pytest.approx(1)
    half = torch.tensor([0.5], dtype=torch.float64)
    assert slope(lambda raw: activations.opacity(raw, half)) == pytest.approx(0.25)


def test_factor_saturates_at_its_limits() -> None:
    raw = torch.tensor([-1e3, 1e3], dtype=torch.float64)
    want = torch.tensor([1 / 16, 16], dtype=torch.float64)
    torch.testing.assert_close(activations.bounded_factor(raw, LIMIT), want)


@given(base=st.floats(1e-6, 1 - 1e-6), raw=st.floats(-30, 30))
@settings(max_examples=25, deadline=None)
def test_opacity_is_a_shifted_sigmoid(base: float, raw: float) -> None:
    raws, bases = torch.tensor([[raw], [base]], dtype=torch.float64)
    got = activations.opacity(raws, bases)
    want = 1 / (1 + math.exp(-(raw + math.log(base) - math.log1p(-base))))
    assert float(got) == pytest.approx(want, rel=1e-9)


@pytest.mark.parametrize("base", [0.0, 1.0])
@pytest.mark.parametrize("raw", [-1e4, 0.0, 1e4])
def test_certain_opacities_stay_and_have_finite_gradients(base: float, raw: float) -> None:
    bases, raws = torch.tensor([base], requires_grad=True), torch.tensor([raw], requires_grad=True)
    out = activations.opacity(raws, bases)
    out.sum().backward()
    assert float(out.detach()) == base
    assert torch.isfinite(bases.grad).all() and torch.isfinite(raws.grad).all()


@pytest.mark.parametrize("base", [0.0, 0.3, 1.0])
def test_color_reaches_black_and_white_from_any_base(base: float) -> None:
    bases = torch.full((1, 3), base)
    assert float(activations.color(torch.full((1, 3), -50.0), bases).max()) <= 0
    assert float(activations.color(torch.full((1, 3), 50.0), bases).min()) >= 1


def test_rotation_follows_the_formula() -> None:
    raw = torch.tensor([[0.5, 1.0, -2.0, 0.25]])
    want = torch.tensor([[1.5, 1.0, -2.0, 0.25]])
    torch.testing.assert_close(activations.rotation(raw), want / want.norm())


def test_rotation_where_the_quaternion_vanishes() -> None:
    raw = torch.tensor([[-1.0, 0, 0, 0]], requires_grad=True)
    out = activations.rotation(raw)
    out.sum().backward()
    torch.testing.assert_close(out, torch.tensor([[1.0, 0, 0, 0]]))
    assert torch.isfinite(raw.grad).all()


def test_stretch_is_the_ratio_of_activated_scales() -> None:
    raw, raw_scale = torch.randn(4, 3).double(), torch.randn(4, 3).double()
    scale = activations.bounded_factor(raw_scale, LIMIT)
    later = activations.bounded_factor(raw_scale + raw, LIMIT)
    torch.testing.assert_close(activations.stretch(raw, raw_scale, LIMIT).exp(), later / scale)


@given(ratio=st.floats(-0.99 * LIMIT, 0.99 * LIMIT))
def test_the_raw_value_of_a_log_ratio_gives_it_again(ratio: float) -> None:
    wanted = torch.tensor([ratio], dtype=torch.float64)
    raw = activations.raw_log_ratio(wanted, LIMIT)
    torch.testing.assert_close(activations.log_ratio(raw, LIMIT), wanted)


@pytest.mark.parametrize("ratio", [LIMIT, -LIMIT, 1e4, -1e4, 3e38])
def test_beyond_the_limit_the_raw_value_is_finite(ratio: float) -> None:
    raw = activations.raw_log_ratio(torch.tensor([ratio]), LIMIT)
    again = float(activations.log_ratio(raw, LIMIT))
    assert math.isfinite(float(raw))
    assert again == pytest.approx(math.copysign(activations.LARGEST_SHARE * LIMIT, ratio), rel=1e-4)
