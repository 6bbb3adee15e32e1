"""Names of CogVideoX's public transformer weights in diffusers → names of ``JointVideoDiT``."""

import re
from collections.abc import Mapping

RENAMED: Mapping[str, str] = {
    r"^patch_embed\.proj\.": "patch_embedding.",
    r"^patch_embed\.text_proj\.": "text_projection.",
    r"^patch_embed\.pos_embedding$": "positions",
    r"^time_embedding\.linear_1\.": "level_mlp.expand.",
    r"^time_embedding\.linear_2\.": "level_mlp.contract.",
    r"^ofs_embedding\.linear_1\.": "offset_mlp.expand.",
    r"^ofs_embedding\.linear_2\.": "offset_mlp.contract.",
    r"^norm_out\.linear\.": "modulation_out.project.",
    r"^norm_out\.norm\.": "norm_out.",
    r"^proj_out\.": "head.",
    r"^transformer_blocks\.": "blocks.",
    r"\.norm1\.linear\.": ".attention_norm.modulation.project.",
    r"\.norm1\.norm\.": ".attention_norm.norm.",
    r"\.norm2\.linear\.": ".feedforward_norm.modulation.project.",
    r"\.norm2\.norm\.": ".feedforward_norm.norm.",
    r"\.attn1\.": ".attention.",
    r"\.to_q\.": ".to_query.",
    r"\.to_k\.": ".to_key.",
    r"\.to_v\.": ".to_value.",
    r"\.to_out\.0\.": ".to_output.",
    r"\.norm_q\.": ".query_norm.",
    r"\.norm_k\.": ".key_norm.",
    r"\.ff\.net\.0\.proj\.": ".feedforward.expand.",
    r"\.ff\.net\.2\.": ".feedforward.contract.",
}
"""Pattern → replacement; all that match are applied, in this order."""


def joint_dit_key(key: str) -> str:
    """Our name of a public weight."""
    for pattern, replacement in RENAMED.items():
        key = re.sub(pattern, replacement, key)
    return key
