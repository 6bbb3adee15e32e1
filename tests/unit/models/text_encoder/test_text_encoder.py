import oracles_models as oracle
import pytest
import torch

from diff4splat.errors import InputError
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.text_encoder.encoder import TextEncoder, distance_buckets, tokenize
from diff4splat.models.text_encoder.prompt import BEGIN, END, PAD

CONFIG = tiny_size().text


@pytest.fixture(scope="module")
def encoder() -> TextEncoder:
    torch.manual_seed(0)
    return oracle.randomised(TextEncoder(CONFIG)).requires_grad_(False)


def test_tokens_are_bytes_between_marks() -> None:
    tokens, mask = tokenize(["aé", "z"], 16)
    assert tokens.tolist() == [[BEGIN, 97, 0xC3, 0xA9, END], [BEGIN, 122, END, PAD, PAD]]
    assert mask.tolist() == [[True] * 5, [True] * 3 + [False] * 2]


def test_one_state_per_byte_and_mark(encoder: TextEncoder) -> None:
    assert encoder.encode_prompt("fox").shape == (1, 5, CONFIG.width)
    assert encoder.encode_prompt("狐" * 170 + "ab").shape == (1, 514, CONFIG.width)


def test_padding_changes_nothing(encoder: TextEncoder) -> None:
    tokens, mask = tokenize(["a", "a longer one"], 64)
    states = encoder(tokens, mask)
    torch.testing.assert_close(states[:1, :3], encoder.encode_prompt("a"), atol=1e-5, rtol=1e-4)
    assert not states[0, 3:].any()


def test_order_of_bytes_matters(encoder: TextEncoder) -> None:
    pooled = [encoder.encode_prompt(text).mean(1) for text in ("ab", "ba")]
    assert (pooled[0] - pooled[1]).abs().max() > 1e-4


@pytest.mark.parametrize("text", ["", "x" * 513])
def test_unusable_prompts_are_refused(encoder: TextEncoder, text: str) -> None:
    with pytest.raises(InputError, match="expected"):
        encoder.encode_prompt(text)


def test_buckets_match_a_loop() -> None:
    got = distance_buckets(200, CONFIG, torch.device("cpu"))
    want = [
        [oracle.t5_bucket(key - query, 32, 128) for key in range(200)] for query in (0, 100, 199)
    ]
    assert got[[0, 100, 199]].tolist() == want
    assert int(got.min()) >= 0 and int(got.max()) < 32
