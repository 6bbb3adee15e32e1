"""A video model that predicts clean latents, and corrects a draft."""

from dataclasses import replace

import pytest
import torch
from oracles_models import randomised
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.flow.path import clean_from_velocity
from diff4splat.flow.samplers import SAMPLERS
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video_sampling import Conditions, sample_video
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.video_dit.dit import VideoDiT

SHAPE = (1, 4, 3, 4, 4)


def sized(predicts: str = "clean", draft: bool = True) -> ModelConfig:
    config = tiny_size()
    return replace(config, dit=replace(config.dit, predicts=predicts, draft=draft))


def latent() -> Tensor:
    return torch.randn(SHAPE)


def sampled(dit: VideoDiT, sampler: str, image: Tensor, draft: Tensor | None) -> Tensor:
    given = Conditions(
        image_latent=image, plucker=torch.randn(1, 6, 9, 32, 32), text=None, draft=draft
    )
    settings = GenerationSettings(steps=5, sampler=sampler, schedule="uniform")
    with torch.no_grad():
        return sample_video(dit, given, settings, seed=0).latent


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_a_fresh_model_leads_any_noise_to_the_draft(sampler: str) -> None:
    image, draft = torch.randn(1, 4, 1, 4, 4), latent()
    found = sampled(VideoDiT(sized()), sampler, image, draft)
    torch.testing.assert_close(found[:, :, :1], image, atol=1e-6, rtol=0)
    torch.testing.assert_close(found[:, :, 1:], draft[:, :, 1:], atol=1e-5, rtol=0)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_without_a_draft_it_leads_to_zero(sampler: str) -> None:
    image = torch.randn(1, 4, 1, 4, 4)
    found = sampled(VideoDiT(sized(draft=False)), sampler, image, None)
    torch.testing.assert_close(found[:, :, :1], image, atol=1e-6, rtol=0)
    torch.testing.assert_close(found[:, :, 1:], torch.zeros(1, 4, 2, 4, 4), atol=1e-5, rtol=0)


def test_frames_of_level_zero_stand() -> None:
    dit = randomised(VideoDiT(sized()))
    velocity = dit(latent(), torch.tensor([[0.0, 0.5, 0.0]]), draft=latent())
    moves = [bool(velocity[:, :, place].any()) for place in range(3)]
    assert moves == [False, True, False]


@pytest.mark.parametrize("draft", [None, torch.randn(SHAPE)])
def test_the_answer_is_added_to_the_draft(draft: Tensor | None) -> None:
    as_velocity = randomised(VideoDiT(sized("velocity", draft is not None)))
    as_clean = VideoDiT(sized("clean", draft is not None))
    as_clean.load_state_dict(as_velocity.state_dict())
    noisy, level = latent(), torch.full((1, 3), 0.7)
    answer = as_velocity(noisy, level, draft=draft)
    clean = clean_from_velocity(noisy, as_clean(noisy, level, draft=draft), 0.7)
    wanted = answer if draft is None else draft + answer
    torch.testing.assert_close(clean, wanted, atol=1e-5, rtol=1e-5)
    assert float(answer.detach().abs().max()) > 0.1


def test_the_draft_is_seen_too() -> None:
    dit = randomised(VideoDiT(sized("velocity")))
    noisy, level = latent(), torch.rand(1, 3)
    one, other = (dit(noisy, level, draft=latent()) for _ in range(2))
    assert float((one - other).detach().abs().max()) > 1e-3


def test_a_fresh_embedding_of_drafts_leaves_the_backbone_bit_for_bit() -> None:
    plain, seeing = randomised(VideoDiT(sized("velocity", False))), VideoDiT(sized("velocity"))
    missing = seeing.load_state_dict(plain.state_dict(), strict=False).missing_keys
    assert missing == ["draft_embedding.weight", "draft_embedding.bias"]
    noisy, level = latent(), torch.rand(1, 3)
    assert torch.equal(seeing(noisy, level, draft=latent()), plain(noisy, level))


def test_sizes_without_drafts_predict_velocity_as_ever() -> None:
    dit = randomised(VideoDiT(tiny_size()))
    assert not any("draft" in key for key in dit.state_dict())
    noisy = latent()
    assert bool(dit(noisy, torch.zeros(1, 3)).any()), "level 0 has a velocity where it is predicted"
    assert not VideoDiT(tiny_size())(noisy, torch.rand(1, 3)).any()


def test_a_missing_draft_is_refused() -> None:
    with pytest.raises(ShapeError, match="draft: expected one, got none"):
        VideoDiT(sized())(latent(), torch.rand(1, 3))


@pytest.mark.parametrize("predicts", ["velocity", "clean"])
def test_a_draft_that_nobody_sees_is_refused(predicts: str) -> None:
    with pytest.raises(ShapeError, match="draft: expected none, got one"):
        VideoDiT(sized(predicts, draft=False)).prepare(draft=latent())


@pytest.mark.parametrize("level", [1.0, 1e-3, 1e-12, 0.0])
def test_gradients_are_finite_at_every_level(level: float) -> None:
    dit = randomised(VideoDiT(sized()))
    noisy, draft = latent().requires_grad_(), latent().requires_grad_()
    velocity = dit(noisy, torch.full((1, 3), level), draft=draft)
    velocity.sum().backward()
    assert bool(velocity.isfinite().all())
    for tensor in (noisy, draft, dit.head.weight, dit.draft_embedding.weight):
        assert bool(tensor.grad.isfinite().all())


def test_a_fresh_model_can_learn_from_its_draft() -> None:
    dit = VideoDiT(sized())
    dit(latent(), torch.full((1, 3), 0.5), draft=latent()).square().sum().backward()
    assert bool(dit.head.weight.grad.any()), "the last layer learns first"
