"""A video model that predicts clean latents, and corrects a render condition."""

from dataclasses import replace

import pytest
import torch
from oracles_models import randomised
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.flow.path import clean_from_velocity
from diff4splat.flow.samplers import SAMPLERS
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.video_sampling import Conditions, sample_video
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.video_dit.conditions import RenderCondition
from diff4splat.models.video_dit.dit import VideoDiT

SHAPE = (1, 4, 3, 4, 4)


def sized(prediction: str = "clean", conditioned: bool = True) -> ModelConfig:
    config = tiny_size()
    dit = replace(config.dit, prediction_type=prediction, render_condition=conditioned)
    return replace(config, dit=dit)


def latent() -> Tensor:
    return torch.randn(SHAPE)


def condition(render: Tensor | None = None) -> RenderCondition:
    return RenderCondition(
        latent=latent() if render is None else render,
        validity=torch.rand(1, 1, 9, 32, 32).round(),
    )


def sampled(dit: VideoDiT, sampler: str, image: Tensor, render: RenderCondition | None) -> Tensor:
    given = Conditions(
        image_latent=image, plucker=torch.randn(1, 6, 9, 32, 32), text=None, render=render
    )
    settings = GenerationSettings(steps=5, sampler=sampler, schedule="uniform")
    with torch.no_grad():
        return sample_video(dit, given, settings, seed=0).latent


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_a_fresh_model_leads_any_noise_to_the_render_condition(sampler: str) -> None:
    image, render = torch.randn(1, 4, 1, 4, 4), condition()
    found = sampled(VideoDiT(sized()), sampler, image, render)
    torch.testing.assert_close(found[:, :, :1], image, atol=1e-6, rtol=0)
    torch.testing.assert_close(found[:, :, 1:], render.latent[:, :, 1:], atol=1e-5, rtol=0)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_without_a_condition_it_leads_to_zero(sampler: str) -> None:
    image = torch.randn(1, 4, 1, 4, 4)
    found = sampled(VideoDiT(sized(conditioned=False)), sampler, image, None)
    torch.testing.assert_close(found[:, :, :1], image, atol=1e-6, rtol=0)
    torch.testing.assert_close(found[:, :, 1:], torch.zeros(1, 4, 2, 4, 4), atol=1e-5, rtol=0)


def test_frames_of_level_zero_have_no_velocity() -> None:
    dit = randomised(VideoDiT(sized()))
    velocity = dit(latent(), torch.tensor([[0.0, 0.5, 0.0]]), condition=condition())
    changed = [bool(velocity[:, :, index].any()) for index in range(3)]
    assert changed == [False, True, False]


@pytest.mark.parametrize("conditioned", [False, True])
def test_the_output_is_added_to_the_render_condition(conditioned: bool) -> None:
    render = condition() if conditioned else None
    as_velocity = randomised(VideoDiT(sized("velocity", conditioned)))
    as_clean = VideoDiT(sized("clean", conditioned))
    as_clean.load_state_dict(as_velocity.state_dict())
    noisy, level = latent(), torch.full((1, 3), 0.7)
    output = as_velocity(noisy, level, condition=render)
    clean = clean_from_velocity(noisy, as_clean(noisy, level, condition=render), 0.7)
    want = output if render is None else render.latent + output
    torch.testing.assert_close(clean, want, atol=1e-5, rtol=1e-5)
    assert float(output.detach().abs().max()) > 0.1


@pytest.mark.parametrize("field", ["latent", "validity"])
def test_latent_and_validity_both_matter(field: str) -> None:
    dit, given = randomised(VideoDiT(sized("velocity"))), condition()
    changed = replace(given, **{field: 1 - getattr(given, field)})
    noisy, level = latent(), torch.rand(1, 3)
    one, other = (dit(noisy, level, condition=render) for render in (given, changed))
    assert float((one - other).detach().abs().max()) > 1e-3


def test_a_fresh_embedding_leaves_the_backbone_bit_for_bit() -> None:
    plain, conditioned = randomised(VideoDiT(sized("velocity", False))), VideoDiT(sized("velocity"))
    missing = conditioned.load_state_dict(plain.state_dict(), strict=False).missing_keys
    assert missing == [
        f"condition_embedding.{key}" for key in ("latent.weight", "latent.bias", "validity.weight")
    ]
    noisy, level = latent(), torch.rand(1, 3)
    assert torch.equal(conditioned(noisy, level, condition=condition()), plain(noisy, level))


def test_a_size_without_conditions_predicts_velocity() -> None:
    dit = randomised(VideoDiT(tiny_size()))
    assert not any("condition" in key for key in dit.state_dict())
    noisy = latent()
    assert bool(dit(noisy, torch.zeros(1, 3)).any()), "level 0 has a velocity where it is predicted"
    assert not VideoDiT(tiny_size())(noisy, torch.rand(1, 3)).any()


def test_a_missing_condition_is_refused() -> None:
    with pytest.raises(ShapeError, match="render condition: expected one, got none"):
        VideoDiT(sized())(latent(), torch.rand(1, 3))


@pytest.mark.parametrize("prediction", ["velocity", "clean"])
def test_a_condition_for_a_model_that_takes_none_is_refused(prediction: str) -> None:
    with pytest.raises(ShapeError, match="render condition: expected none, got one"):
        VideoDiT(sized(prediction, conditioned=False)).prepare(condition=condition())


@pytest.mark.parametrize("level", [1.0, 1e-3, 1e-12, 0.0])
def test_gradients_are_finite_at_every_level(level: float) -> None:
    dit = randomised(VideoDiT(sized()))
    noisy, render = latent().requires_grad_(), condition(latent().requires_grad_())
    velocity = dit(noisy, torch.full((1, 3), level), condition=render)
    velocity.sum().backward()
    assert bool(velocity.isfinite().all())
    embedding = dit.condition_embedding
    for tensor in (
        noisy,
        render.latent,
        dit.head.weight,
        embedding.latent.weight,
        embedding.validity.weight,
    ):
        assert bool(tensor.grad.isfinite().all())


def test_a_fresh_model_can_learn_from_its_condition() -> None:
    dit = VideoDiT(sized())
    dit(latent(), torch.full((1, 3), 0.5), condition=condition()).square().sum().backward()
    assert bool(dit.head.weight.grad.any()), "the last layer learns first"
