"""T5: states of a prompt are those of transformers, padding included."""

from pathlib import Path

import cogvideox_folder
import pytest
import torch

from diff4splat.models.cogvideox.t5 import T5Encoder
from diff4splat.models.hub.model import load_model


@pytest.fixture
def encoder(imported_cogvideox: dict[str, Path]) -> T5Encoder:
    return load_model(imported_cogvideox["2b"], parts=("text_encoder",)).networks.text_encoder


@torch.no_grad()
@pytest.mark.parametrize("prompt", ["", "the red car", "the unheard moves " * 30])
def test_states_are_those_of_transformers(encoder: T5Encoder, prompt: str) -> None:
    row = encoder.token_row(prompt)
    assert len(row) == cogvideox_folder.TEXT_TOKENS
    want = cogvideox_folder.text_encoder()(torch.tensor([row])).last_hidden_state
    got = encoder.encode_prompt(prompt)
    assert float((got - want).abs().max() / want.abs().max()) < 1e-5


@torch.no_grad()
def test_long_sequences_share_distance_buckets(encoder: T5Encoder) -> None:
    tokens = torch.randint(3, 10, (2, 226))
    want = cogvideox_folder.text_encoder()(tokens).last_hidden_state
    got = encoder(tokens)
    assert float((got - want).abs().max() / want.abs().max()) < 1e-5


@torch.no_grad()
def test_half_precision_is_as_exact_as_that_of_transformers(encoder: T5Encoder) -> None:
    tokens = torch.randint(3, 10, (1, 20))
    theirs = cogvideox_folder.text_encoder()
    want = theirs(tokens).last_hidden_state
    half = theirs.bfloat16()(tokens).last_hidden_state.float()
    got = encoder.to(torch.bfloat16)(tokens).float()
    assert (got - want).abs().max() < 1.5 * (half - want).abs().max() + 0.01 * want.abs().max()


@torch.no_grad()
def test_all_tokens_of_several_prompts_count(encoder: T5Encoder) -> None:
    states, mask = encoder.encode_prompts(["the red car", ""])
    assert states.shape[:2] == mask.shape == (2, cogvideox_folder.TEXT_TOKENS)
    assert bool(mask.all())
    assert torch.equal(states[1:], encoder.encode_prompt(""))
