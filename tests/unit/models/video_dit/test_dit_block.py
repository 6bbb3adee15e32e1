import oracles_models as oracle
import torch

from diff4splat.models.blocks.rope import rope_tables
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.video_dit.conditions import DitConditions
from diff4splat.models.video_dit.dit_block import DitBlock

CONFIG = tiny_size().dit
ROPE = rope_tables((2, 1, 2), CONFIG.width // CONFIG.heads, torch.device("cpu"))


def block() -> DitBlock:
    return oracle.randomised(DitBlock(CONFIG)).requires_grad_(False)


def normed(tokens: torch.Tensor) -> torch.Tensor:
    centred = tokens - tokens.mean(-1, keepdim=True)
    return centred / (centred.square().mean(-1, keepdim=True) + 1e-6).sqrt()


def test_block_follows_the_formula() -> None:
    trained, tokens = block(), torch.randn(1, 2, 2, CONFIG.width)
    modulation, text = torch.randn(1, 2, 6, CONFIG.width), torch.randn(1, 3, CONFIG.width)
    shift, scale, gate, ff_shift, ff_scale, ff_gate = (modulation + trained.modulation)[
        :, :, :, None
    ].unbind(2)
    quiet = normed(tokens) * (1 + scale) + shift
    want = tokens + gate * trained.attention(quiet.reshape(1, 4, -1), rope=ROPE).reshape(
        tokens.shape
    )
    asked = normed(want) * trained.text_norm.weight + trained.text_norm.bias
    want = want + trained.text_attention(asked.reshape(1, 4, -1), context=text).reshape(
        tokens.shape
    )
    want = want + ff_gate * trained.feedforward(normed(want) * (1 + ff_scale) + ff_shift)
    got = trained(tokens, modulation, ROPE, DitConditions(text=text))
    torch.testing.assert_close(got, want, atol=1e-5, rtol=1e-5)


def test_fresh_block_is_the_identity() -> None:
    tokens, text = torch.randn(1, 2, 2, CONFIG.width), torch.randn(1, 3, CONFIG.width)
    no_modulation = torch.zeros(1, 2, 6, CONFIG.width)
    assert torch.equal(
        DitBlock(CONFIG)(tokens, no_modulation, ROPE, DitConditions(text=text)), tokens
    )
