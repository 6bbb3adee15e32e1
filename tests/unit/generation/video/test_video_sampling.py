"""Which passes of the video model the solver runs, recorded by a stand-in."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from diff4splat.flow.guidance import Guidance
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.video_sampling import Conditions, initial_noise, sample_video
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.video_dit.conditions import DitConditions, ImageCondition
from diff4splat.models.video_dit.dit import VideoDiT

STEPS = 8


class RecordingDit(VideoDiT):
    """Returns its input and records every call."""

    def __init__(self) -> None:
        super().__init__(size_by_name("test"))
        self.levels: list[Tensor] = []
        self.with_text: list[bool] = []

    def velocity(self, latent: Tensor, level: Tensor, conditions: DitConditions) -> Tensor:
        self.levels.append(level)
        self.with_text.append(conditions.text is not None)
        return latent


def conditions(with_text: bool) -> Conditions:
    return Conditions(
        image_latent=torch.randn(1, 4, 1, 4, 4),
        plucker=torch.randn(1, 6, 9, 32, 32),
        text=torch.randn(1, 3, 16) if with_text else None,
    )


def settings(weight: float) -> GenerationSettings:
    guidance = Guidance(weight=weight, low=0.2, high=0.9)
    return GenerationSettings(steps=STEPS, sampler="euler", schedule="uniform", guidance=guidance)


def test_the_image_frame_is_clean_at_every_level() -> None:
    dit = RecordingDit()
    sample_video(dit, conditions(with_text=False), settings(4.0), seed=0)
    expected = [1 - i / STEPS for i in range(STEPS)]
    for level, levels in zip(expected, dit.levels, strict=True):
        assert levels[0, 0] == 0
        assert levels[0, 1:].tolist() == pytest.approx([level, level])


def test_without_text_there_is_one_pass_per_step_and_none_sees_text() -> None:
    dit = RecordingDit()
    video = sample_video(dit, conditions(with_text=False), settings(4.0), seed=0)
    assert dit.with_text == [False] * STEPS
    assert video.calls.saved == STEPS


def test_with_text_the_other_pass_runs_inside_the_interval_only() -> None:
    dit = RecordingDit()
    video = sample_video(dit, conditions(with_text=True), settings(4.0), seed=0)
    inside = [0.2 <= 1 - i / STEPS <= 0.9 for i in range(STEPS)]
    assert dit.with_text.count(True) == STEPS
    assert dit.with_text.count(False) == sum(inside)
    assert video.calls.saved == STEPS - sum(inside)


def test_a_weight_of_one_needs_no_other_pass() -> None:
    dit = RecordingDit()
    sample_video(dit, conditions(with_text=True), settings(1.0), seed=0)
    assert dit.with_text == [True] * STEPS


def test_noise_is_seeded_and_keeps_the_image() -> None:
    given = conditions(with_text=False)
    first, again, other = (initial_noise(given, seed) for seed in (3, 3, 4))
    assert first.shape == (1, 4, 3, 4, 4)
    assert torch.equal(first, again)
    assert torch.equal(first[:, :, :1], given.image_latent)
    assert not torch.equal(first, other)
    single = replace(given, plucker=given.plucker[:, :, :1])
    assert torch.equal(initial_noise(single, 0), given.image_latent)


def test_a_negative_prompt_is_what_the_other_pass_sees() -> None:
    dit = RecordingDit()
    given = replace(conditions(with_text=True), negative_text=torch.randn(1, 5, 16))
    sample_video(dit, given, settings(4.0), seed=0)
    inside = [0.2 <= 1 - i / STEPS <= 0.9 for i in range(STEPS)]
    assert dit.with_text == [True] * (STEPS + sum(inside))


def test_without_a_prompt_the_empty_one_is_the_only_pass() -> None:
    dit = RecordingDit()
    given = replace(conditions(with_text=False), negative_text=torch.randn(1, 1, 16))
    sample_video(dit, given, settings(4.0), seed=0)
    assert dit.with_text == [True] * STEPS


def test_a_model_that_takes_the_image_as_channels_makes_every_frame() -> None:
    dit = RecordingDit()
    given = replace(conditions(with_text=False), image=ImageCondition())
    noise = initial_noise(given, seed=0)
    assert noise.shape == (1, 4, 3, 4, 4)
    assert not torch.equal(noise[:, :, :1], given.image_latent)
    sample_video(dit, given, settings(1.0), seed=0)
    for levels in dit.levels:
        assert len(set(levels[0].tolist())) == 1
