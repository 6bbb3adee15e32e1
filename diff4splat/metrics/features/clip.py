"""CLIP (Radford et al. 2021), without its weights: images and sentences in one space.

Axes: ``n`` images or sentences, ``s`` tokens or patches, ``d`` features, ``h w`` pixels. RGB in
[0, 1]. A folder in the layout of Hugging Face (``config.json``, ``model.safetensors``,
``vocab.json``, ``merges.txt``), any vision transformer size. Images are resized by their shorter
side and cut to a square; both embeddings have length 1.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.metrics.checks import promote
from diff4splat.metrics.features.clip_tokens import ClipTokens, read_tokens
from diff4splat.metrics.features.tensor_files import digest, read_tensors, refuse

MEAN = (0.48145466, 0.4578275, 0.40821073)
DEVIATION = (0.26862954, 0.26130258, 0.27577711)
CONFIG, WEIGHTS = "config.json", "model.safetensors"
VISION, TEXT = "vision_model", "text_model"
MAX_HEADS = 256


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """``TextImageFeatures`` with given weights."""

    weights: dict[str, Tensor]
    tokens: ClipTokens
    heads: dict[str, int]
    """Attention heads of both towers."""

    @property
    def name(self) -> str:
        """The network, and the first digits of the SHA-256 of its weights."""
        return f"CLIP (weights {digest(self.weights)[:8]})"

    @property
    def side_px(self) -> int:
        """Of the square that the network sees."""
        patches = len(self._get(f"{VISION}.embeddings.position_embedding.weight")) - 1
        return math.isqrt(patches) * self._patch.shape[-1]

    @torch.no_grad()
    def embed_images(self, images: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n d"]:
        """Embeddings of images."""
        (images,) = promote(images)
        patches = functional.conv2d(
            _standardized(images, self.side_px), self._patch, stride=self._patch.shape[-1]
        )
        first = self._get(f"{VISION}.embeddings.class_embedding").expand(len(images), 1, -1)
        state = torch.cat([first, patches.flatten(2).mT], 1)
        state = state + self._get(f"{VISION}.embeddings.position_embedding.weight")
        # The name is misspelt in the published weights.
        state = self._tower(VISION, self._norm(f"{VISION}.pre_layrnorm", state), None)
        pooled = self._norm(f"{VISION}.post_layernorm", state[:, 0])
        return functional.normalize(pooled @ self._get("visual_projection.weight").mT, dim=-1)

    @torch.no_grad()
    def embed_texts(self, texts: list[str]) -> Float[Tensor, "n d"]:
        """Embeddings of sentences; what is too long is cut."""
        positions = self._get(f"{TEXT}.embeddings.position_embedding.weight")
        rows = [self.tokens.encode(text, len(positions)) for text in texts]
        return torch.cat([self._embed_tokens(torch.tensor([row])) for row in rows])

    def _embed_tokens(self, tokens: Int[Tensor, "1 s"]) -> Float[Tensor, "1 d"]:
        count = tokens.shape[1]
        state = self._get(f"{TEXT}.embeddings.token_embedding.weight")[tokens]
        state = state + self._get(f"{TEXT}.embeddings.position_embedding.weight")[:count]
        hidden = torch.full((count, count), -math.inf).triu(1)
        state = self._norm(f"{TEXT}.final_layer_norm", self._tower(TEXT, state, hidden))
        # The last token marks the end of the text.
        return functional.normalize(state[:, -1] @ self._get("text_projection.weight").mT, dim=-1)

    def _tower(self, tower: str, state: Tensor, hidden: Tensor | None) -> Tensor:
        layer = 0
        while f"{tower}.encoder.layers.{layer}.mlp.fc1.weight" in self.weights:
            prefix = f"{tower}.encoder.layers.{layer}"
            normed = self._norm(f"{prefix}.layer_norm1", state)
            state = state + self._attend(f"{prefix}.self_attn", normed, hidden, self.heads[tower])
            inner = self._linear(f"{prefix}.mlp.fc1", self._norm(f"{prefix}.layer_norm2", state))
            state = state + self._linear(f"{prefix}.mlp.fc2", inner * (1.702 * inner).sigmoid())
            layer += 1
        return state

    def _attend(self, prefix: str, state: Tensor, hidden: Tensor | None, heads: int) -> Tensor:
        query, key, value = (
            self._linear(f"{prefix}.{part}_proj", state).unflatten(-1, (heads, -1)).transpose(1, 2)
            for part in ("q", "k", "v")
        )
        mixed = functional.scaled_dot_product_attention(query, key, value, attn_mask=hidden)
        return self._linear(f"{prefix}.out_proj", mixed.transpose(1, 2).flatten(2))

    def _linear(self, name: str, state: Tensor) -> Tensor:
        return functional.linear(state, self._get(f"{name}.weight"), self._get(f"{name}.bias"))

    def _norm(self, name: str, state: Tensor) -> Tensor:
        weight = self._get(f"{name}.weight")
        return functional.layer_norm(state, weight.shape, weight, self._get(f"{name}.bias"))

    @property
    def _patch(self) -> Tensor:
        return self._get(f"{VISION}.embeddings.patch_embedding.weight")

    def _get(self, name: str) -> Tensor:
        if name not in self.weights:
            raise CheckpointError(f"CLIP weights: missing {name}; choose the folder of a CLIP")
        return self.weights[name]


def read_clip(folder: Path) -> Clip:
    """CLIP of a folder.

    Raises:
        CheckpointError: a file or a weight is missing, or has another shape.
        FileFormatError: a file is damaged.
    """
    heads = _read_heads(folder / CONFIG)
    found = {key: value.float() for key, value in read_tensors(folder / WEIGHTS).items()}
    refuse([key for key in found if not found[key].isfinite().all()], "CLIP weights: not finite in")
    clip = Clip(weights=found, tokens=read_tokens(folder), heads=heads)
    try:
        # A picture and a word find whatever does not fit.
        clip.embed_images(torch.zeros(1, 3, 8, 8))
        clip.embed_texts(["a"])
    except (RuntimeError, IndexError, ValueError) as error:
        raise CheckpointError(
            f"{folder}: expected the weights of a CLIP, got other shapes ({error}); "
            "fetch the folder again"
        ) from error
    return clip


def _read_heads(file: Path) -> dict[str, int]:
    if not file.is_file():
        raise CheckpointError(f"{file}: expected the settings of a CLIP, got none; check the path")
    try:
        config = json.loads(file.read_text(encoding="utf-8"))
        parts = {VISION: config["vision_config"], TEXT: config["text_config"]}
        # Published settings leave out what is usual.
        usual = {VISION: 12, TEXT: 8}
        heads = {
            name: int(part.get("num_attention_heads", usual[name])) for name, part in parts.items()
        }
    except (ValueError, KeyError, TypeError, AttributeError, OSError, RecursionError) as error:
        raise FileFormatError(
            f"{file}: expected the settings of a CLIP, got something else; fetch the folder again"
        ) from error
    if not all(1 <= count <= MAX_HEADS for count in heads.values()):
        raise FileFormatError(f"{file}: expected 1 to {MAX_HEADS} attention heads, got {heads}")
    return heads


def _standardized(images: Float[Tensor, "n 3 h w"], side_px: int) -> Tensor:
    """The middle square at the size of the network."""
    height, width = images.shape[-2:]
    scale = side_px / min(height, width)
    size = [max(round(side * scale), side_px) for side in (height, width)]
    resized = functional.interpolate(
        images, size, mode="bicubic", align_corners=False, antialias=True
    ).clamp(0, 1)
    top, left = ((side - side_px) // 2 for side in size)
    square = resized[..., top : top + side_px, left : left + side_px]
    mean, deviation = (square.new_tensor(values)[:, None, None] for values in (MEAN, DEVIATION))
    return (square - mean) / deviation
