"""CLIP's vision transformer in transformers → ours: settings and names of weights."""

import re
from collections.abc import Mapping

from diff4splat.models.config.image_encoder import ImageEncoderConfig
from diff4splat.models.public_weights.settings import (
    Source,
    count,
    require_settings,
    unsupported,
)

CLASSES = ("CLIPVisionModel", "CLIPVisionModelWithProjection")
WHERE = "image_encoder/config.json"
RENAMED: Mapping[str, str] = {
    r"^vision_model\.": "",
    r"^embeddings\.patch_embedding\.": "patch_embedding.",
    r"^embeddings\.class_embedding$": "class_embedding",
    r"^embeddings\.position_embedding\.weight$": "position_embedding",
    r"^pre_layrnorm\.": "norm_in.",
    r"^encoder\.layers\.": "blocks.",
    r"\.self_attn\.q_proj\.": ".to_query.",
    r"\.self_attn\.k_proj\.": ".to_key.",
    r"\.self_attn\.v_proj\.": ".to_value.",
    r"\.self_attn\.out_proj\.": ".to_output.",
    r"\.layer_norm1\.": ".attention_norm.",
    r"\.layer_norm2\.": ".feedforward_norm.",
    r"\.mlp\.fc1\.": ".expand.",
    r"\.mlp\.fc2\.": ".contract.",
}
"""Pattern → replacement; all that match are applied, in this order."""
UNUSED = re.compile(
    r"(vision_model\.)?(post_layernorm\.|embeddings\.position_ids$)|visual_projection\."
)
"""What comes after the states, and a table of whole numbers."""


def image_encoder_config(source: Source) -> ImageEncoderConfig:
    """Of ``image_encoder/config.json``.

    Raises:
        CheckpointError: a setting that no supported model has.
    """
    require_settings(source, WHERE, layer_norm_eps=1e-5, num_channels=3)
    layers, activation = count(source, "num_hidden_layers", WHERE), source.get("hidden_act")
    if layers < 2:
        raise unsupported(WHERE, "num_hidden_layers", "at least 2", layers)
    if activation not in ("gelu", "quick_gelu"):
        raise unsupported(WHERE, "hidden_act", "gelu or quick_gelu", activation)
    return ImageEncoderConfig(
        width=count(source, "hidden_size", WHERE),
        blocks=layers - 1,
        heads=count(source, "num_attention_heads", WHERE),
        feedforward_width=count(source, "intermediate_size", WHERE),
        size_px=count(source, "image_size", WHERE),
        patch_px=count(source, "patch_size", WHERE),
        activation=activation,
    )


def image_encoder_key(key: str, blocks: int) -> str | None:
    """Our name of a public weight; None for what the states do not depend on."""
    if UNUSED.match(key):
        return None
    for pattern, replacement in RENAMED.items():
        key = re.sub(pattern, replacement, key)
    return None if key.startswith(f"blocks.{blocks}.") else key
