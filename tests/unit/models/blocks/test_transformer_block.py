import torch
from oracles_models import randomised

from diff4splat.models.blocks.feedforward import FeedForward
from diff4splat.models.blocks.rope import rope_tables
from diff4splat.models.blocks.transformer_block import TransformerBlock


def test_block_follows_the_formula() -> None:
    block = randomised(TransformerBlock(12, 2, 20)).requires_grad_(False)
    tokens, rope = torch.randn(2, 4, 12), rope_tables((1, 2, 2), 6, torch.device("cpu"))
    want = tokens + block.attention(block.attention_norm(tokens), rope=rope)
    want = want + block.feedforward(block.feedforward_norm(want))
    assert torch.equal(block(tokens, rope), want)
    assert (block(tokens, rope) - tokens).abs().mean() > 0.1


def test_feedforward_uses_the_tanh_form() -> None:
    feedforward = randomised(FeedForward(4, 8)).double()
    tokens = torch.randn(3, 4, dtype=torch.float64)
    hidden = feedforward.expand(tokens)
    inner = (2 / torch.pi) ** 0.5 * (hidden + 0.044715 * hidden**3)
    want = feedforward.contract(0.5 * hidden * (1 + torch.tanh(inner)))
    torch.testing.assert_close(feedforward(tokens), want)
