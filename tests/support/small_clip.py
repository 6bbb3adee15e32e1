"""Folders of a CLIP with random weights and a vocabulary of bytes and a few merges."""

import json
from pathlib import Path

import torch
from safetensors.torch import save_file
from torch import Tensor

from diff4splat.metrics.features.clip_tokens import END_OF_WORD, FIRST, LAST, _byte_letters

WIDTH, HEADS, LAYERS, SIDE_PX, PATCH_PX, TOKENS, SPACE = 16, 2, 2, 16, 8, 12, 6
MERGES = [("r", "e"), ("re", "d" + END_OF_WORD), ("c", "a"), ("ca", "r" + END_OF_WORD)]


def vocabulary() -> dict[str, int]:
    """Bytes, bytes at the end of a word, merges, start and end."""
    letters = list(_byte_letters().values())
    words = [*letters, *(letter + END_OF_WORD for letter in letters)]
    words += ["".join(pair) for pair in MERGES] + [FIRST, LAST]
    return {word: number for number, word in enumerate(words)}


def clip_weights(seed: int = 0) -> dict[str, Tensor]:
    """The names of the published state."""
    generator = torch.Generator().manual_seed(seed)

    def normal(*shape: int) -> Tensor:
        return 0.3 * torch.randn(*shape, generator=generator)

    patches = (SIDE_PX // PATCH_PX) ** 2
    weights = {
        "vision_model.embeddings.class_embedding": normal(WIDTH),
        "vision_model.embeddings.patch_embedding.weight": normal(WIDTH, 3, PATCH_PX, PATCH_PX),
        "vision_model.embeddings.position_embedding.weight": normal(patches + 1, WIDTH),
        "text_model.embeddings.token_embedding.weight": normal(len(vocabulary()), WIDTH),
        "text_model.embeddings.position_embedding.weight": normal(TOKENS, WIDTH),
        "visual_projection.weight": normal(SPACE, WIDTH),
        "text_projection.weight": normal(SPACE, WIDTH),
        "logit_scale": torch.tensor(2.0),
    }
    norms = ["vision_model.pre_layrnorm", "vision_model.post_layernorm"]
    norms.append("text_model.final_layer_norm")
    for tower in ("vision_model", "text_model"):
        for layer in range(LAYERS):
            prefix = f"{tower}.encoder.layers.{layer}"
            norms += [f"{prefix}.layer_norm1", f"{prefix}.layer_norm2"]
            for part in ("q", "k", "v", "out"):
                weights[f"{prefix}.self_attn.{part}_proj.weight"] = normal(WIDTH, WIDTH)
                weights[f"{prefix}.self_attn.{part}_proj.bias"] = normal(WIDTH)
            for part, shape in (("fc1", (32, WIDTH)), ("fc2", (WIDTH, 32))):
                weights[f"{prefix}.mlp.{part}.weight"] = normal(*shape)
                weights[f"{prefix}.mlp.{part}.bias"] = normal(shape[0])
    for name in norms:
        weights |= {f"{name}.weight": 1 + normal(WIDTH), f"{name}.bias": normal(WIDTH)}
    return weights


def write_clip(folder: Path, seed: int = 0) -> Path:
    """A folder that ``read_clip`` takes."""
    folder.mkdir(parents=True, exist_ok=True)
    tower = {"num_attention_heads": HEADS}
    config = {"vision_config": tower, "text_config": tower}
    (folder / "config.json").write_text(json.dumps(config))
    (folder / "vocab.json").write_text(json.dumps(vocabulary()))
    merges = [" ".join(pair) for pair in MERGES]
    (folder / "merges.txt").write_text("\n".join(["#version: 0.2", *merges]) + "\n")
    save_file(clip_weights(seed), folder / "model.safetensors")
    return folder
