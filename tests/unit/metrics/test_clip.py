"""CLIP with random weights: tokens as published, embeddings of length 1, bad folders refused."""

import json
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file
from small_clip import TOKENS, clip_weights, vocabulary, write_clip

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.metrics.features.aesthetic import read_aesthetic
from diff4splat.metrics.features.clip import Clip, read_clip
from diff4splat.metrics.features.clip_tokens import FIRST, LAST
from diff4splat.metrics.features.protocol import TextImageFeatures


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_clip(tmp_path_factory.mktemp("clip"))


@pytest.fixture(scope="module")
def clip(folder: Path) -> Clip:
    return read_clip(folder)


def words(clip: Clip, text: str, limit: int = 77) -> list[str]:
    names = {number: word for word, number in vocabulary().items()}
    return [names[token] for token in clip.tokens.encode(text, limit)]


def test_pairs_are_joined_in_the_order_of_merges(clip: Clip) -> None:
    assert words(clip, "Red  CAR") == [FIRST, "red</w>", "car</w>", LAST]
    assert words(clip, "cared rec") == [FIRST, "ca", "red</w>", "re", "c</w>", LAST]
    assert words(clip, "it's 42!") == [
        *(FIRST, "i", "t</w>", "'", "s</w>", "4</w>", "2</w>", "!</w>", LAST)
    ]


def test_every_text_has_tokens_and_long_ones_are_cut(clip: Clip) -> None:
    assert words(clip, "") == [FIRST, LAST]
    assert len(words(clip, "ä😀 \x00 _")) > 4
    long = words(clip, "red " * 10_000, TOKENS)
    assert len(long) == TOKENS
    assert long[-1] == LAST


def test_embeddings_have_length_one_and_do_not_depend_on_the_batch(clip: Clip) -> None:
    assert isinstance(clip, TextImageFeatures)
    assert clip.side_px == 16
    images = torch.rand(3, 3, 20, 33, generator=torch.Generator().manual_seed(0))
    found = clip.embed_images(images)
    assert torch.allclose(found.norm(dim=-1), torch.ones(3))
    assert torch.allclose(clip.embed_images(images[1:2]), found[1:2], atol=1e-5)
    texts = clip.embed_texts(["red car", "a red car moves to the left", "red car"])
    assert torch.allclose(texts.norm(dim=-1), torch.ones(3))
    assert torch.equal(texts[0], texts[2])
    assert not torch.allclose(texts[0], texts[1], atol=1e-3)


def test_only_the_middle_square_is_seen(clip: Clip) -> None:
    images = torch.rand(1, 3, 16, 40, generator=torch.Generator().manual_seed(1))
    other = images.clone()
    other[..., :11] = other[..., -11:] = 0
    assert torch.allclose(clip.embed_images(images), clip.embed_images(other), atol=1e-5)


def test_weights_tell_folders_apart(clip: Clip, tmp_path: Path) -> None:
    assert read_clip(write_clip(tmp_path / "other", seed=1)).name != clip.name


def edit(folder: Path, name: str, content: str | None) -> None:
    (folder / name).unlink()
    if content is not None:
        (folder / name).write_text(content)


@pytest.mark.parametrize(
    ("name", "content", "kind"),
    [
        ("config.json", None, CheckpointError),
        ("config.json", "[1]", FileFormatError),
        ("config.json", '{"vision_config": {"num_attention_heads": 0}}', FileFormatError),
        ("vocab.json", None, CheckpointError),
        ("vocab.json", json.dumps({"a": "b"}), FileFormatError),
        ("vocab.json", "[" * 100_000, FileFormatError),
        ("merges.txt", None, CheckpointError),
        ("model.safetensors", None, CheckpointError),
        ("model.safetensors", "no tensors", FileFormatError),
    ],
)
def test_bad_folders_are_refused(
    tmp_path: Path, name: str, content: str | None, kind: type
) -> None:
    folder = write_clip(tmp_path / "clip")
    edit(folder, name, content)
    with pytest.raises(kind, match=r"expected|missing"):
        read_clip(folder)


@pytest.mark.parametrize("change", ["missing", "shape", "nan"])
def test_bad_weights_are_refused(tmp_path: Path, change: str) -> None:
    folder, weights = write_clip(tmp_path / "clip"), clip_weights()
    name = "text_model.encoder.layers.1.mlp.fc2.weight"
    if change == "missing":
        del weights[name]
    else:
        bad = torch.zeros(3, 3) if change == "shape" else weights[name] * torch.nan
        weights[name] = bad
    save_file(weights, folder / "model.safetensors")
    with pytest.raises(CheckpointError):
        read_clip(folder)


def test_an_aesthetic_head_is_a_linear_map_of_the_embedding(clip: Clip, tmp_path: Path) -> None:
    head = {
        "layers.0.weight": torch.eye(6)[:2] * 3,
        "layers.0.bias": torch.tensor([1.0, 0.0]),
        "layers.2.weight": torch.tensor([[1.0, 2.0]]),
        "layers.2.bias": torch.tensor([0.5]),
    }
    file = tmp_path / "head.safetensors"
    save_file(head, file)
    judge = read_aesthetic(file, clip)
    images = torch.rand(2, 3, 16, 16)
    embedded = clip.embed_images(images)
    wanted = 3 * embedded[:, 0] + 6 * embedded[:, 1] + 1.5
    assert torch.allclose(judge.score(images), wanted, atol=1e-5)
    assert "aesthetic" in judge.name
    del head["layers.2.bias"]
    save_file(head, file)
    with pytest.raises(CheckpointError, match="layers"):
        read_aesthetic(file, clip)
