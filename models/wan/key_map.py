"""Names of Wan's public transformer weights in diffusers → names of ``VideoDiT``."""

import re
from collections.abc import Mapping

RENAMED: Mapping[str, str] = {
    r"^condition_embedder\.time_embedder\.linear_1": "level_mlp.expand",
    r"^condition_embedder\.time_embedder\.linear_2": "level_mlp.contract",
    r"^condition_embedder\.time_proj": "level_modulation.project",
    r"^condition_embedder\.text_embedder\.linear_1": "text_projection.expand",
    r"^condition_embedder\.text_embedder\.linear_2": "text_projection.contract",
    r"^condition_embedder\.image_embedder\.norm1": "image_projection.norm_in",
    r"^condition_embedder\.image_embedder\.norm2": "image_projection.norm_out",
    r"^condition_embedder\.image_embedder\.ff\.net\.0\.proj": "image_projection.expand",
    r"^condition_embedder\.image_embedder\.ff\.net\.2": "image_projection.contract",
    r"^scale_shift_table$": "modulation_out",
    r"^proj_out": "head",
    r"\.attn1\.": ".attention.",
    r"\.attn2\.": ".text_attention.",
    r"\.to_q\.": ".to_query.",
    r"\.to_k\.": ".to_key.",
    r"\.to_v\.": ".to_value.",
    r"\.to_out\.0\.": ".to_output.",
    r"\.norm_q\.": ".query_norm.",
    r"\.norm_k\.": ".key_norm.",
    r"\.add_k_proj\.": ".to_image_key.",
    r"\.add_v_proj\.": ".to_image_value.",
    r"\.norm_added_k\.": ".image_key_norm.",
    r"\.norm2\.": ".text_norm.",
    r"\.ffn\.net\.0\.proj\.": ".feedforward.expand.",
    r"\.ffn\.net\.2\.": ".feedforward.contract.",
    r"\.scale_shift_table$": ".modulation",
}
"""Pattern → replacement; all that match are applied, in this order."""
IGNORED = ".norm_added_q."
"""In some files, but no model uses it."""


def video_dit_key(key: str) -> str | None:
    """Our name of a public weight; None for one that nothing uses."""
    if IGNORED in key:
        return None
    for pattern, replacement in RENAMED.items():
        key = re.sub(pattern, replacement, key)
    return key
