"""Errors of object masks against their formulas, with gradients, and where nothing is asked for."""

import math

import pytest
import torch
from torch import Tensor

from diff4splat.training.losses.object_mask import (
    INSTANCE_WEIGHT,
    NO_NAME_WEIGHT,
    SMOOTHING_PX,
    UNKNOWN_NAME,
    absent_error,
    cross_entropy,
    dice_error,
    instance_error,
    name_error,
)


def example() -> tuple[Tensor, Tensor]:
    torch.manual_seed(0)
    masks = torch.rand(2, 3, 4, 5) < 0.3
    masks[0, 1] = False
    return torch.randn(2, 3, 4, 5).double(), masks


def test_cross_entropy_is_that_of_every_pixel() -> None:
    logits, masks = example()
    for batch in range(2):
        total = 0.0
        for logit, truth in zip(
            logits[batch].flatten().tolist(), masks[batch].flatten().tolist(), strict=True
        ):
            probability = 1 / (1 + math.exp(-logit))
            total -= math.log(probability if truth else 1 - probability)
        assert float(cross_entropy(logits, masks)[batch]) == pytest.approx(total / 60)


def test_dice_is_that_of_prompts_that_ask_for_something() -> None:
    logits, masks = example()
    expected = []
    for prompt in (0, 2):
        probability, truth = logits[0, prompt].sigmoid(), masks[0, prompt].double()
        both = float(probability.sum() + truth.sum())
        shared = 2 * float((probability * truth).sum())
        expected.append(1 - (shared + SMOOTHING_PX) / (both + SMOOTHING_PX))
    assert float(dice_error(logits, masks)[0]) == pytest.approx(sum(expected) / 2)


@pytest.mark.parametrize("error", [cross_entropy, dice_error])
def test_gradients(error: object) -> None:
    logits, masks = example()
    assert torch.autograd.gradcheck(lambda x: error(x, masks), logits.requires_grad_())


@pytest.mark.parametrize("error", [cross_entropy, dice_error])
@pytest.mark.parametrize("logit", [-1e4, 0.0, 1e4])
def test_extreme_logits_and_empty_masks(error: object, logit: float) -> None:
    for truth in (False, True):
        logits = torch.full((1, 2, 3, 3), logit, requires_grad=True)
        value = error(logits, torch.full((1, 2, 3, 3), truth))
        value.sum().backward()
        assert bool(value.isfinite().all()) and bool(logits.grad.isfinite().all())


def test_without_any_object_only_the_cross_entropy_teaches() -> None:
    logits = torch.zeros(1, 2, 3, 3)
    masks = torch.zeros(1, 2, 3, 3, dtype=torch.bool)
    assert float(dice_error(logits, masks)) == 0.0
    assert float(cross_entropy(logits, masks)) == pytest.approx(math.log(2))


def test_names_are_weighted_pixel_by_pixel() -> None:
    torch.manual_seed(0)
    logits, names = torch.randn(1, 4, 2, 3).double(), torch.tensor([[[0, 1, 3], [2, 0, 0]]])
    shares = logits.softmax(1)
    total = weight = 0.0
    for row in range(2):
        for column in range(3):
            name = int(names[0, row, column])
            own = 1.0 if name else NO_NAME_WEIGHT
            total -= own * math.log(float(shares[0, name, row, column]))
            weight += own
    assert float(name_error(logits, names)) == pytest.approx(total / weight)
    assert torch.autograd.gradcheck(lambda x: name_error(x, names), logits.requires_grad_())


def test_pixels_of_unknown_name_do_not_count() -> None:
    logits = torch.randn(1, 4, 2, 3, generator=torch.Generator().manual_seed(0)).double()
    names = torch.tensor([[[0, 1, UNKNOWN_NAME], [2, 0, UNKNOWN_NAME]]])
    assert torch.equal(name_error(logits, names), name_error(logits[..., :2], names[..., :2]))
    nothing = logits.requires_grad_()
    error = name_error(nothing, torch.full((1, 2, 3), UNKNOWN_NAME))
    error.sum().backward()
    assert float(error.detach()) == 0 and not bool(nothing.grad.any())


def instances_of(logits: Tensor, masks: Tensor) -> Tensor:
    return instance_error(logits, masks, torch.ones(masks.shape[:2], dtype=torch.bool))


def test_instance_error_weighs_pixels_of_small_objects() -> None:
    logits, masks = example()
    valid = torch.tensor([[True, False, True], [False] * 3])
    expected = []
    for seed in (0, 2):
        truth, total = masks[0, seed].flatten(), 0.0
        area = min(max(int(truth.sum()), 80), 8000)
        weight = min(max(20 / (2 * area), 1), 20) ** 0.5
        for logit, inside in zip(logits[0, seed].flatten().tolist(), truth.tolist(), strict=True):
            probability = 1 / (1 + math.exp(-logit))
            total -= weight * math.log(probability) if inside else math.log(1 - probability)
        overlap = dice_error(logits[:1, seed : seed + 1], masks[:1, seed : seed + 1])
        expected.append(INSTANCE_WEIGHT * total / 20 + float(overlap))
    error = instance_error(logits, masks, valid)
    assert float(error[0]) == pytest.approx(sum(expected) / 2)
    assert float(error[1]) == 0.0


def test_instance_error_has_gradients_and_takes_extremes() -> None:
    logits, masks = example()
    assert torch.autograd.gradcheck(lambda x: instances_of(x, masks), logits.requires_grad_())
    for logit in (-1e4, 1e4):
        extreme = torch.full((1, 2, 3, 3), logit, requires_grad=True)
        value = instances_of(extreme, torch.zeros(1, 2, 3, 3, dtype=torch.bool))
        value.sum().backward()
        assert bool(value.isfinite().all()) and bool(extreme.grad.isfinite().all())


def test_a_hundred_pixels_weigh_more_than_a_thousand() -> None:
    small, large = (torch.zeros(1, 1, 128, 128, dtype=torch.bool) for _ in range(2))
    small[..., :10, :10], large[..., :40, :25] = True, True
    missed = [float(instances_of(torch.where(m, -5.0, -9.0), m) - 1) for m in (small, large)]
    assert missed[0] / 100 > 1.5 * missed[1] / 1000 > 0


def test_absent_error_is_that_of_the_highest_pixels() -> None:
    logits = torch.full((1, 2, 20, 20), -30.0)
    logits[0, :, 4:12, 4:14] = 2.0
    masks = torch.zeros(1, 2, 20, 20, dtype=torch.bool)
    masks[0, 0, 0, 0] = True
    wanted = torch.nn.functional.softplus(torch.tensor(2.0))
    torch.testing.assert_close(absent_error(logits, masks), wanted[None])
    assert not absent_error(logits[:, :1], masks[:, :1]).any()


def test_absent_error_takes_images_of_fewer_pixels() -> None:
    error = absent_error(torch.zeros(1, 1, 3, 3), torch.zeros(1, 1, 3, 3, dtype=torch.bool))
    torch.testing.assert_close(error, torch.tensor([0.6931472]))
