"""Errors of a shadow: oracles from the formulas, and what does not count."""

import pytest
import torch

from diff4splat.training.losses.object_shadow import (
    BEND,
    DARKENING_RANGE,
    LEAST_COLOR,
    LEAST_DARKENING,
    SHADOW_WEIGHT,
    darkening_error,
    lit_color_error,
    true_darkening,
)


def pair() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(0)
    without = 0.3 + 0.6 * torch.rand(2, 3, 6, 8, generator=generator, dtype=torch.float64)
    image = without * (0.4 + 0.6 * torch.rand(2, 1, 6, 8, generator=generator).double())
    valid = torch.rand(2, 6, 8, generator=generator) > 0.3
    return image, without, valid


def test_the_true_darkening_is_a_log_ratio() -> None:
    image, without, _ = pair()
    wanted = ((without + LEAST_COLOR) / (image + LEAST_COLOR)).log()
    assert torch.allclose(true_darkening(image, without), wanted.clamp(*DARKENING_RANGE))


@pytest.mark.parametrize(("image", "without"), [(0.0, 1.0), (1.0, 0.0), (0.0, 0.0)])
def test_extreme_colours_have_a_bounded_darkening(image: float, without: float) -> None:
    found = true_darkening(torch.full((1, 3, 2, 2), image), torch.full((1, 3, 2, 2), without))
    low, high = DARKENING_RANGE
    assert low - 1e-6 <= float(found.min()) and float(found.max()) <= high + 1e-6


@pytest.mark.parametrize(
    ("far", "error_of_far"), [(0.1, 0.1**2 / (2 * BEND)), (0.7, 0.7 - BEND / 2)]
)
def test_both_errors_are_those_of_the_formulas(far: float, error_of_far: float) -> None:
    image, without, valid = pair()
    truth = true_darkening(image, without)
    found = truth + far
    for sample in range(2):
        own = valid[sample]
        weight = 1 + SHADOW_WEIGHT * (truth[sample] > LEAST_DARKENING).double()
        wanted = (weight * error_of_far).mean(0)[own].mean()
        assert float(darkening_error(found, truth, valid)[sample]) == pytest.approx(float(wanted))
        lit = (image * found.exp()).clamp_max(1) - without
        wanted = lit.square().mean(1)[sample][own].mean()
        error = lit_color_error(found, image, without, valid)[sample]
        assert float(error) == pytest.approx(float(wanted))


def test_pixels_of_the_object_do_not_count() -> None:
    image, without, valid = pair()
    found = torch.zeros_like(image, requires_grad=True)
    loss = darkening_error(found, true_darkening(image, without), valid)
    loss = loss + lit_color_error(found, image, without, valid)
    loss.sum().backward()
    hidden = ~valid[:, None].expand_as(image)
    assert not found.grad[hidden].any()
    assert bool(found.grad.isfinite().all())


def test_an_image_without_a_valid_pixel_has_finite_errors() -> None:
    image, without, valid = pair()
    nothing = torch.zeros_like(valid)
    error = darkening_error(image, true_darkening(image, without), nothing)
    assert bool(error.isfinite().all())


def test_gradients() -> None:
    image, without, valid = pair()
    truth = true_darkening(image, without)
    given = (0.1 * torch.randn_like(image)).requires_grad_()
    assert torch.autograd.gradcheck(lambda s: darkening_error(s, truth, valid), (given,))
    assert torch.autograd.gradcheck(
        lambda s: lit_color_error(s, 0.3 * image, without, valid), (given,)
    )
