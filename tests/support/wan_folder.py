"""Tiny random Wan models, saved by diffusers and transformers themselves."""

import json
from pathlib import Path

import pytest
import torch

HEADS, HEAD_WIDTH, TEXT_WIDTH, CLIP_WIDTH = 2, 12, 16, 20
BOUNDARY, LOW_SEED = 0.875, 8
"""Of the two experts."""
MEAN, STD = [0.1, -0.2, 0.3, 0.0], [1.5, 2.0, 0.5, 1.0]


def spread_(module: torch.nn.Module) -> torch.nn.Module:
    """Random values in every weight: what starts at zero or one would hide mistakes."""
    with torch.no_grad():
        for name, value in module.named_parameters():
            centre = 1.0 if "norm" in name and name.endswith("weight") else 0.0
            centre = 1.0 if name.endswith("gamma") else centre
            spread = value[0].numel() ** -0.5 if value.dim() > 1 and centre == 0 else 0.2
            value.normal_(centre, spread)
    return module.eval()


def transformer(kind: str = "t2v", seed: int = 1, **changes):
    """``t2v``, ``i2v`` (mask, image latents, CLIP), ``ti2v`` or ``a14b``, one expert of two."""
    diffusers = pytest.importorskip("diffusers", reason="needs the package diffusers")
    given = {
        "num_attention_heads": HEADS,
        "attention_head_dim": HEAD_WIDTH,
        "in_channels": 12 if kind == "i2v" else 4,
        "out_channels": 4,
        "text_dim": TEXT_WIDTH,
        "freq_dim": 16,
        "ffn_dim": 40,
        "num_layers": 2,
        "image_dim": CLIP_WIDTH if kind == "i2v" else None,
        "added_kv_proj_dim": HEADS * HEAD_WIDTH if kind == "i2v" else None,
    }
    torch.manual_seed(seed)
    return spread_(diffusers.WanTransformer3DModel(**given | changes))


def vae(version: str = "2.1"):
    """A tiny autoencoder of Wan 2.1 or 2.2."""
    diffusers = pytest.importorskip("diffusers", reason="needs the package diffusers")
    given = {
        "base_dim": 6,
        "z_dim": 4,
        "dim_mult": [1, 2, 2, 2],
        "num_res_blocks": 1,
        "temperal_downsample": [False, True, True],
        "latents_mean": MEAN,
        "latents_std": STD,
    }
    if version == "2.2":
        given |= {"is_residual": True, "patch_size": 2, "in_channels": 12, "out_channels": 12}
        given |= {"decoder_base_dim": 8, "scale_factor_spatial": 16}
    torch.manual_seed(2)
    return spread_(diffusers.AutoencoderKLWan(**given))


def text_encoder():
    """A tiny UMT5."""
    transformers = pytest.importorskip("transformers", reason="needs the package transformers")
    torch.manual_seed(3)
    config = transformers.UMT5Config(
        vocab_size=len(WORDS), d_model=TEXT_WIDTH, d_kv=6, d_ff=24, num_layers=2, num_heads=2
    )
    return spread_(transformers.UMT5EncoderModel(config))


def image_encoder():
    """A tiny vision transformer of CLIP."""
    transformers = pytest.importorskip("transformers", reason="needs the package transformers")
    torch.manual_seed(4)
    config = transformers.CLIPVisionConfig(
        hidden_size=CLIP_WIDTH,
        intermediate_size=24,
        num_hidden_layers=3,
        num_attention_heads=2,
        image_size=28,
        patch_size=7,
        hidden_act="gelu",
    )
    return spread_(transformers.CLIPVisionModel(config))


WORDS = ("<pad>", "</s>", "<unk>", "the", "red", "car", "moves", "to", "left", "blurry")


def write_tokenizer(folder: Path) -> None:
    """Whole words, and the end token after each prompt."""
    tokenizers = pytest.importorskip("tokenizers", reason="needs the package tokenizers")
    model = tokenizers.models.WordLevel({word: n for n, word in enumerate(WORDS)}, "<unk>")
    tokenizer = tokenizers.Tokenizer(model)
    tokenizer.pre_tokenizer = tokenizers.pre_tokenizers.Whitespace()
    tokenizer.post_processor = tokenizers.processors.TemplateProcessing(
        single="$A </s>", special_tokens=[("</s>", 1)]
    )
    folder.mkdir(parents=True, exist_ok=True)
    tokenizer.save(str(folder / "tokenizer.json"))


def write_wan(
    folder: Path, kind: str = "t2v", dtype: torch.dtype = torch.float32, **options
) -> Path:
    """A whole model folder, saved by the libraries; ``max_shard_size`` cuts it into shards."""
    version = "2.2" if kind == "ti2v" else "2.1"
    transformer(kind).to(dtype).save_pretrained(folder / "transformer", **options)
    vae(version).save_pretrained(folder / "vae")
    text_encoder().to(dtype).save_pretrained(folder / "text_encoder", **options)
    write_tokenizer(folder / "tokenizer")
    index = {"_class_name": "WanImageToVideoPipeline" if kind == "i2v" else "WanPipeline"}
    if kind == "i2v":
        image_encoder().to(dtype).save_pretrained(folder / "image_encoder", **options)
    if kind == "a14b":
        low = transformer(kind, seed=LOW_SEED).to(dtype)
        low.save_pretrained(folder / "transformer_2", **options)
        index["boundary_ratio"] = BOUNDARY
    (folder / "model_index.json").write_text(json.dumps(index))
    return folder
