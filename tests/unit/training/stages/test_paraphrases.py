"""Sentences of one meaning: what their difference is, and what it teaches."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_stage, shake_heads, stage_recipe
from torch import Tensor, nn

from diff4splat.models.config.model import MotionUNetConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.training.recipe.losses import MotionDiffusionLosses
from diff4splat.training.stages.paraphrases import PAIRS, PART_PX, paraphrase_error
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
    """The motion is the sum of the text states, or nothing of the text."""

    def __init__(self, reads: bool) -> None:
        super().__init__()
        self.weight, self.reads = nn.Parameter(torch.ones(())), reads
        self.sizes: list[torch.Size] = []
        self.learning: list[bool] = []

    def forward(
        self, image: Tensor, noisy: Tensor, level: Tensor, text: Tensor, mask: Tensor
    ) -> Tensor:
        self.sizes.append(image.shape)
        self.learning.append(torch.is_grad_enabled())
        assert level.eq(1).all() and len(text) == len(mask) == len(image)
        said = text.sum((1, 2))[:, None, None, None, None] if self.reads else 1.0
        return self.weight * said + 0 * noisy


@pytest.fixture(scope="module")
def text() -> TextConditioning:
    stage = make_stage(RECIPE, model=MODEL)
    return TextConditioning(encoder=stage.text_encoder, plan=stage.plan)


def generators(*seeds: int) -> list[torch.Generator]:
    return [torch.Generator().manual_seed(seed) for seed in seeds]


def test_a_network_that_does_not_read_has_no_error(text: TextConditioning) -> None:
    network = Reader(reads=False)
    error = paraphrase_error(network, text, torch.rand(2, 3, 64, 48), generators(0, 1))
    assert error.shape == (2,) and not bool(error.any())
    assert network.sizes == [(2 * PAIRS, 3, PART_PX, PART_PX)] * 2


def test_a_network_that_reads_has_one_and_only_free_sentences_teach(text: TextConditioning) -> None:
    network = Reader(reads=True)
    error = paraphrase_error(network, text, torch.rand(2, 3, 32, 32), generators(0, 1))
    assert bool((error > 0).all())
    error.sum().backward()
    assert network.learning == [False, True] and float(network.weight.grad) != 0
    again = paraphrase_error(network, text, torch.rand(1, 3, 32, 32), generators(1))
    torch.testing.assert_close(again, error[1:])


def test_small_and_black_images_have_finite_errors(text: TextConditioning) -> None:
    for images in (torch.zeros(1, 3, 16, 16), torch.ones(1, 3, 16, 160)):
        network = Reader(reads=True)
        error = paraphrase_error(network, text, images, generators(3))
        error.sum().backward()
        assert bool(error.isfinite().all()) and bool(network.weight.grad.isfinite())
        assert network.sizes[0][2:] == (16, 16)


def test_a_motion_of_nothing_has_a_finite_error(text: TextConditioning) -> None:
    network = Reader(reads=True)
    network.weight.data.zero_()
    assert not bool(paraphrase_error(network, text, torch.rand(1, 3, 32, 32), generators(0)).any())


def test_the_text_adapter_learns_from_it() -> None:
    stage = make_stage(RECIPE, model=MODEL)
    shake_heads(stage)
    text = TextConditioning(encoder=stage.text_encoder, plan=stage.plan)
    images = torch.rand(2, 3, 32, 32)
    paraphrase_error(stage.motion_unet, text, images, generators(5, 6)).sum().backward()
    adapter = stage.motion_unet.text_adapter
    gradients = [one.grad for one in adapter.parameters() if one.grad is not None]
    assert any(bool(one.any()) for one in gradients)
    assert all(bool(one.isfinite().all()) for one in gradients)
