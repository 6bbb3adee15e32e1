"""UMT5: states of a prompt are those of transformers, padding included."""

import html
from pathlib import Path

import pytest
import torch
import wan_folder

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.models.hub.model import load_model
from diff4splat.models.video_dit.padded_text import with_padding
from diff4splat.models.wan.tokenizer import Tokenizer, clean_prompt
from diff4splat.models.wan.umt5 import Umt5Encoder


@pytest.fixture
def encoder(imported: dict[str, Path]) -> Umt5Encoder:
    return load_model(imported["t2v"], parts=("text_encoder",)).networks.text_encoder


@torch.no_grad()
@pytest.mark.parametrize("prompt", ["", "the red car", "the unheard moves " * 30])
def test_states_are_those_of_transformers(encoder: Umt5Encoder, prompt: str) -> None:
    row = encoder.tokenizer.token_row(prompt)
    padded = torch.tensor([row + [0] * (128 - len(row))])
    mask = (torch.arange(128) < len(row)).long()[None]
    want = wan_folder.text_encoder()(padded, attention_mask=mask).last_hidden_state[:, : len(row)]
    got = encoder.encode_prompt(prompt)
    assert float((got - want).abs().max() / want.abs().max()) < 1e-5


@torch.no_grad()
def test_one_token_stands_for_all_padding() -> None:
    text, mask = torch.randn(2, 5, 6), torch.arange(5)[None] < torch.tensor([[5], [3]])
    short, logits = with_padding(text * mask[..., None], mask, 12)
    whole = torch.cat([text * mask[..., None], torch.zeros(2, 7, 6)], 1)
    query, value = torch.randn(2, 4, 6), torch.randn(6, 3)
    want = (query @ whole.mT).softmax(-1) @ (whole @ value)
    got = (query @ short.mT + logits[:, None]).softmax(-1) @ (short @ value)
    torch.testing.assert_close(got, want)


@torch.no_grad()
@pytest.mark.parametrize("length", [4, 5])
def test_a_prompt_as_long_as_the_padding_gets_none(length: int) -> None:
    text = torch.randn(1, 5, 6)
    short, logits = with_padding(text, None, length)
    weights = (torch.randn(1, 2, 6) @ short.mT + logits[:, None]).softmax(-1)
    assert bool((weights[..., -1] == 0).all())
    assert short.shape[1] == length + 1


def test_prompts_are_cut_to_what_the_model_takes(encoder: Umt5Encoder) -> None:
    row = encoder.tokenizer.token_row("car " * 1000)
    assert len(row) == 512
    assert row[-1] == 1, "the end token stays"


def test_prompts_are_cleaned_as_wan_does() -> None:
    assert clean_prompt("  a &amp;lt; b\n\nc ") == "a < b c"
    assert clean_prompt(html.escape("<")) == "<"


def test_an_encoder_without_vocabulary_says_so(encoder: Umt5Encoder) -> None:
    encoder.tokenizer = None
    with pytest.raises(ConfigError, match=r"tokenizer\.json"):
        encoder.encode_prompt("car")


def test_a_damaged_vocabulary_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("tokenizers")
    (tmp_path / "tokenizer.json").write_text('{"model": 3}')
    with pytest.raises(FileFormatError, match="damaged"):
        Tokenizer(tmp_path / "tokenizer.json", 512)
