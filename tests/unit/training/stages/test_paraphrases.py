"""Sentences of one meaning: what their difference is, and what it teaches."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_stage, shake_heads, stage_recipe
from torch import Tensor, nn

from diff4splat.models.config.model import MotionUNetConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.training.recipe.losses import MotionDiffusionLosses
from diff4splat.training.stages.paraphrases import PAIRS, paraphrase_error
from diff4splat.training.stages.text_conditioning import TextConditioning

MODEL = replace(tiny_size(), motion_unet=MotionUNetConfig(width=16, heads=2))
RECIPE = replace(
    stage_recipe("video_diffusion"),
    name="motion_diffusion",
    kind="motion_diffusion",
    trained=("motion_unet",),
    losses=MotionDiffusionLosses(motion_mask=0.5, paraphrase=1.0),
)


class Reader(nn.Module):
    """The condition is a projection of the text states, or nothing of the text."""

    def __init__(self, reads: bool) -> None:
        super().__init__()
        self.weight, self.reads = nn.Parameter(torch.ones(3)), reads
        self.learning: list[bool] = []

    def text_readings(self, text: Tensor, mask: Tensor, features: torch.Generator) -> list[Tensor]:
        """A reading of width 3, and the same by random features of width 2."""
        assert text.shape[:2] == mask.shape
        self.learning.append(torch.is_grad_enabled())
        said = text.sum((1, 2)) if self.reads else text.new_ones(len(text))
        random = torch.rand(2, generator=features).to(said)
        return [said[:, None] * self.weight, said[:, None] * self.weight[:2] * random]


@pytest.fixture(scope="module")
def text() -> TextConditioning:
    stage = make_stage(RECIPE, model=MODEL)
    return TextConditioning(encoder=stage.text_encoder, plan=stage.plan)


def generators(*seeds: int) -> list[torch.Generator]:
    return [torch.Generator().manual_seed(seed) for seed in seeds]


def test_a_network_that_does_not_read_has_no_error(text: TextConditioning) -> None:
    error = paraphrase_error(Reader(reads=False), text, generators(0, 1), *generators(9))
    assert error.shape == (2,) and not bool(error.any())


def test_only_free_sentences_teach(text: TextConditioning) -> None:
    network = Reader(reads=True)
    error = paraphrase_error(network, text, generators(0, 1), *generators(9))
    assert bool((error > 0).all()) and network.learning == [False, True]
    error.sum().backward()
    assert bool(network.weight.grad.isfinite().all()) and bool(network.weight.grad.any())


def test_a_sample_has_its_error_in_any_batch_and_at_any_scale(text: TextConditioning) -> None:
    network = Reader(reads=True)
    both = paraphrase_error(network, text, generators(0, 1), *generators(9)).detach()
    torch.testing.assert_close(
        paraphrase_error(network, text, generators(1), *generators(9)).detach(), both[1:]
    )
    network.weight.data *= 10
    torch.testing.assert_close(
        paraphrase_error(network, text, generators(0, 1), *generators(9)).detach(), both
    )


def test_the_error_is_that_of_its_definition(text: TextConditioning) -> None:
    network, seen = Reader(reads=True).double(), []
    read = network.text_readings
    network.text_readings = lambda *given: seen.append(read(*given)) or seen[-1]
    error = paraphrase_error(network, text, generators(4), *generators(9))
    plain, free = ([one.detach() for one in readings] for readings in seen)
    assert [one.shape for one in plain] == [(PAIRS, 3), (PAIRS, 2)]
    expected = [
        (said - meant).square().mean() / meant.var(0).mean()
        for said, meant in zip(free, plain, strict=True)
    ]
    torch.testing.assert_close(error.detach(), torch.stack(expected).mean()[None])


def test_the_text_adapter_learns_and_both_come_closer() -> None:
    torch.manual_seed(0)
    stage = make_stage(RECIPE, model=MODEL)
    shake_heads(stage)
    text = TextConditioning(encoder=stage.text_encoder, plan=stage.plan)
    adapter = stage.motion_unet.text_adapter
    optimizer, errors = torch.optim.Adam(adapter.parameters(), lr=1e-2), []
    for _ in range(12):
        error = paraphrase_error(stage.motion_unet, text, generators(5, 6), *generators(9)).mean()
        optimizer.zero_grad()
        error.backward()
        optimizer.step()
        errors.append(error.item())
    assert errors[-1] < 0.7 * errors[0]
