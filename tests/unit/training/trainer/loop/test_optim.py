"""Schedule, groups, norm and clipping against formulas written again here."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_training import ToyStage

from diff4splat.errors import ConfigError
from diff4splat.training.recipe.optimizer import OptimizerSettings
from diff4splat.training.trainer.distributed.parallel import freeze, trained_parameters
from diff4splat.training.trainer.loop.optim import (
    clip_gradient,
    create_optimizer,
    gradient_norm,
    schedule,
    set_learning_rate,
)


def oracle(step: int, steps: int, warmup: int, final: float) -> float:
    if step < warmup:
        return (step + 1) / warmup
    angle = math.pi * min(1, (step - warmup) / max(1, steps - warmup))
    return final + (1 - final) * (1 + math.cos(angle)) / 2


@settings(max_examples=50, deadline=None)
@given(
    step=st.integers(0, 300),
    steps=st.integers(1, 300),
    warmup=st.integers(0, 400),
    final=st.floats(0, 1),
)
def test_schedule(step: int, steps: int, warmup: int, final: float) -> None:
    own = OptimizerSettings(warmup_steps=warmup, final_fraction=final)
    share = schedule(step, steps, own)
    assert share == pytest.approx(oracle(step, steps, warmup, final), abs=1e-12)
    assert 0 <= share <= 1


def test_schedule_has_its_peak_where_warm_up_ends() -> None:
    own = OptimizerSettings(warmup_steps=10, final_fraction=0.1)
    assert schedule(9, 100, own) == schedule(10, 100, own) == 1
    assert schedule(100, 100, own) == pytest.approx(0.1)
    assert schedule(55, 100, own) == pytest.approx(0.55)


def stage_and_optimizer(**changes: object) -> tuple[ToyStage, torch.optim.AdamW]:
    stage = ToyStage()
    freeze(stage)
    own = OptimizerSettings(learning_rate=0.5, weight_decay=0.1, **changes)
    return stage, create_optimizer(trained_parameters(stage), own)


def test_only_matrices_decay_and_parts_have_their_rates() -> None:
    stage, optimizer = stage_and_optimizer(part_rates=(("body", 0.1),))
    set_learning_rate(optimizer, 0.25)
    found = {
        id(parameter): (group["weight_decay"], group["lr"])
        for group in optimizer.param_groups
        for parameter in group["params"]
    }
    assert found[id(stage.head.weight)] == (0.1, 0.25)
    assert found[id(stage.head.bias)] == (0.0, 0.25)
    assert found[id(stage.body.blocks[0].weight)] == (0.1, 0.025)
    assert found[id(stage.body.norm.weight)] == (0.0, 0.025)
    assert len(found) == len(trained_parameters(stage))


def test_a_module_has_a_rate_of_its_own_within_its_part() -> None:
    stage, optimizer = stage_and_optimizer(part_rates=(("body.norm", 0.01), ("body", 0.1)))
    set_learning_rate(optimizer, 1.0)
    found = {
        id(parameter): group["lr"]
        for group in optimizer.param_groups
        for parameter in group["params"]
    }
    assert found[id(stage.body.norm.weight)] == 0.01
    assert found[id(stage.body.blocks[0].weight)] == 0.1
    assert found[id(stage.head.weight)] == 1.0


@pytest.mark.parametrize("holder", ["eyes", "bod", "body.nor"])
def test_a_rate_for_what_does_not_learn_is_refused(holder: str) -> None:
    expected = rf"parts that learn \(body, head\), or modules in them, got {holder};"
    with pytest.raises(ConfigError, match=expected):
        stage_and_optimizer(part_rates=((holder, 0.1),))


def test_moments_made_beforehand_change_nothing() -> None:
    stage, optimizer = stage_and_optimizer()
    twin, _ = stage_and_optimizer()
    plain = torch.optim.AdamW(
        [{"params": [p], "weight_decay": 0.1 if p.ndim > 1 else 0.0} for p in (twin.head.weight,)],
        lr=0.5,
        betas=(0.9, 0.95),
    )
    for _ in range(3):
        for weight, own in ((stage.head.weight, optimizer), (twin.head.weight, plain)):
            weight.grad = weight.detach().sin()
            own.step()
    torch.testing.assert_close(stage.head.weight, twin.head.weight, rtol=0, atol=0)


def test_norm_and_clipping() -> None:
    weights = [torch.zeros(2, requires_grad=True), torch.zeros(1, requires_grad=True)]
    weights[0].grad, weights[1].grad = torch.tensor([3.0, 0.0]), torch.tensor([4.0])
    assert gradient_norm(weights) == 5
    clip_gradient(weights, 5.0, 10.0)
    assert gradient_norm(weights) == 5
    clip_gradient(weights, 5.0, 1.0)
    torch.testing.assert_close(weights[0].grad, torch.tensor([0.6, 0.0]))
    torch.testing.assert_close(weights[1].grad, torch.tensor([0.8]))
    weights[1].grad[0] = torch.nan
    assert math.isnan(gradient_norm(weights))
    weights[1].grad[0] = torch.inf
    assert math.isinf(gradient_norm(weights))
    assert gradient_norm([torch.zeros(1, requires_grad=True)]) == 0
