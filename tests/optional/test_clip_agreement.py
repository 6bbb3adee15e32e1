"""CLIP against the transformers package, with random weights."""

from pathlib import Path

import pytest
import torch
from small_clip import (
    HEADS,
    LAYERS,
    PATCH_PX,
    SIDE_PX,
    SPACE,
    TOKENS,
    WIDTH,
    vocabulary,
    write_clip,
)

from diff4splat.metrics.features.clip import DEVIATION, MEAN, read_clip
from diff4splat.metrics.features.clip_tokens import LAST

transformers = pytest.importorskip("transformers")


def test_embeddings_are_those_of_the_package(tmp_path: Path) -> None:
    ours = read_clip(write_clip(tmp_path / "clip"))
    tower = {
        "hidden_size": WIDTH,
        "intermediate_size": 32,
        "num_hidden_layers": LAYERS,
        "num_attention_heads": HEADS,
        "projection_dim": SPACE,
    }
    end = vocabulary()[LAST]
    config = transformers.CLIPConfig(
        text_config=tower
        | {"vocab_size": len(vocabulary()), "max_position_embeddings": TOKENS, "eos_token_id": end},
        vision_config=tower | {"image_size": SIDE_PX, "patch_size": PATCH_PX},
        projection_dim=SPACE,
    )
    theirs = transformers.CLIPModel(config).eval()
    missing = theirs.load_state_dict(ours.weights, strict=False)
    assert not missing.unexpected_keys
    assert all("position_ids" in key for key in missing.missing_keys)
    images = torch.rand(2, 3, SIDE_PX, SIDE_PX)
    mean, deviation = (torch.tensor(v)[:, None, None] for v in (MEAN, DEVIATION))
    text = "a red car moves"
    tokens = torch.tensor([ours.tokens.encode(text, TOKENS)])
    with torch.no_grad():
        result = theirs(input_ids=tokens, pixel_values=(images - mean) / deviation)
    assert torch.allclose(ours.embed_images(images), result.image_embeds, atol=1e-5)
    assert torch.allclose(ours.embed_texts([text]), result.text_embeds, atol=1e-5)
    tokenizer = transformers.CLIPTokenizer(
        str(tmp_path / "clip" / "vocab.json"), str(tmp_path / "clip" / "merges.txt")
    )
    for sentence in (text, "It's 42, re-cared!", "Café  ROUGE"):
        assert ours.tokens.encode(sentence, 77) == tokenizer(sentence)["input_ids"]
