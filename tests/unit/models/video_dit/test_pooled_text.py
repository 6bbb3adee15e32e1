"""The mean of the text states modulates the video model's blocks."""

from dataclasses import replace

import torch

from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.video_dit.dit import VideoDiT

LATENT, LEVELS = (1, 4, 2, 4, 4), torch.tensor([[0.0, 0.5]])


def pooling() -> VideoDiT:
    config = tiny_size()
    torch.manual_seed(0)
    dit = VideoDiT(replace(config, dit=replace(config.dit, pooled_text=True)))
    for parameter in (dit.head.weight, dit.level_modulation.project.weight):
        torch.nn.init.normal_(parameter, std=0.5)
    return dit


def test_it_says_nothing_when_fresh() -> None:
    dit = pooling()
    pooled = dit.prepare(text=torch.randn(1, 3, 16)).pooled_text
    assert pooled.shape == (1, 24) and not bool(pooled.any())
    assert dit.prepare().pooled_text is None
    assert VideoDiT(tiny_size()).prepare(text=torch.randn(1, 3, 16)).pooled_text is None


def test_padding_does_not_count() -> None:
    dit, text = pooling(), torch.randn(1, 3, 16)
    torch.nn.init.normal_(dit.pooled_text.weight)
    padded = torch.cat([text, torch.randn(1, 2, 16)], 1)
    mask = torch.tensor([[True, True, True, False, False]])
    alone, hidden = (
        dit.prepare(text=given, text_mask=own).pooled_text
        for given, own in ((text, None), (padded, mask))
    )
    torch.testing.assert_close(alone, hidden)


def test_it_reaches_the_answer_without_attention() -> None:
    dit, latent = pooling(), torch.randn(LATENT)
    torch.nn.init.normal_(dit.pooled_text.weight)
    one, other = (dit(latent, LEVELS, text=torch.full((1, 2, 16), value)) for value in (0.5, -0.5))
    assert float((one - other).detach().abs().max()) > 1e-3
