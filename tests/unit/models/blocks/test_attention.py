import oracles_models as oracle
import pytest
import torch

from diff4splat.models.blocks.attention import Attention, attend
from diff4splat.models.blocks.rope import rope_tables


def test_attend_matches_a_loop() -> None:
    query, key, value = torch.randn(2, 3, 2, 4), torch.randn(2, 5, 2, 4), torch.randn(2, 5, 2, 4)
    want = oracle.attention(query, key, value)
    torch.testing.assert_close(attend(query, key, value).double(), want, atol=1e-6, rtol=0)


def test_self_attention_turns_queries_and_keys_alike() -> None:
    attention, grid = Attention(12, 2), (2, 1, 2)
    tokens = torch.randn(1, 4, 12)
    query, key, value = (
        layer(tokens).unflatten(-1, (2, 6))
        for layer in (
            lambda x: attention.query_norm(attention.to_query(x)),
            lambda x: attention.key_norm(attention.to_key(x)),
            attention.to_value,
        )
    )
    turned = [oracle.rotated(heads.detach(), grid, (2, 2, 2)) for heads in (query, key)]
    want = attention.to_output(oracle.attention(*turned, value.detach()).float())
    got = attention(tokens, rope=rope_tables(grid, 6, tokens.device))
    torch.testing.assert_close(got, want, atol=1e-5, rtol=0)


def test_hidden_tokens_do_not_count() -> None:
    attention = Attention(12, 2, context_width=5)
    tokens, context = torch.randn(2, 3, 12), torch.randn(2, 4, 5)
    mask = torch.tensor([[True, True, False, False]]).expand(2, 4)
    masked = attention(tokens, context=context, mask=mask)
    torch.testing.assert_close(masked, attention(tokens, context=context[:, :2]))


def test_norm_makes_scores_independent_of_the_queries_scale() -> None:
    attention = Attention(12, 2)
    torch.nn.init.zeros_(attention.to_query.bias)
    tokens = torch.randn(1, 4, 12)
    context = torch.randn(1, 4, 12)
    small, large = attention(tokens, context=context), attention(1e3 * tokens, context=context)
    torch.testing.assert_close(small, large, atol=1e-4, rtol=1e-3)


def test_position_matters_only_with_rope() -> None:
    attention = Attention(12, 2)
    tokens = torch.randn(1, 8, 12)
    flipped = tokens.flip(1)
    torch.testing.assert_close(attention(tokens).flip(1), attention(flipped), atol=1e-5, rtol=0)
    rope = rope_tables((2, 2, 2), 6, tokens.device)
    assert (attention(tokens, rope=rope).flip(1) - attention(flipped, rope=rope)).abs().max() > 1e-4


@pytest.mark.parametrize("scale", [0.0, 1e-20, 1e4, 1e15])
def test_extreme_tokens_stay_finite(scale: float) -> None:
    attention = Attention(12, 2)
    tokens = (torch.randn(1, 4, 12) * scale).requires_grad_()
    out = attention(tokens)
    out.sum().backward()
    assert torch.isfinite(out).all() and torch.isfinite(tokens.grad).all()


def test_gradcheck() -> None:
    attention = Attention(6, 1).double()
    tokens = torch.randn(1, 3, 6, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(attention, tokens)
