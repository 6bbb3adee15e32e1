"""Folders that others made: what is wrong is said before any weight is read or written."""

import json
import shutil
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from imported_models import settings
from safetensors.torch import load_file, save_file

from diff4splat.errors import CheckpointError, Diff4SplatError, FileFormatError
from diff4splat.models.public_weights.import_model import open_public_model, write_model

Change = Callable[[Path], None]


@pytest.fixture
def folder(wan_source: Path, tmp_path: Path) -> Path:
    """A copy to spoil."""
    return shutil.copytree(wan_source, tmp_path / "source")


def shard(folder: Path) -> Path:
    return sorted((folder / "transformer").glob("*.safetensors"))[1]


def edit(file: Path, **values: object) -> None:
    file.write_text(json.dumps(json.loads(file.read_text()) | values))


def rewritten(folder: Path, change: Callable[[dict], dict]) -> None:
    file = shard(folder)
    save_file(change(load_file(file)), file)


def half_of_a_shard(folder: Path) -> None:
    content = shard(folder).read_bytes()
    shard(folder).write_bytes(content[: len(content) // 2])


def wrong_hash(folder: Path) -> None:
    name = shard(folder).relative_to(folder)
    (folder / "SHA256SUMS").write_text(f"{'0' * 64}  {name}\n")


def link_outside(folder: Path) -> None:
    target = folder.parent / "elsewhere.safetensors"
    shutil.move(shard(folder), target)
    (folder / "transformer" / "diffusion_pytorch_model-00002-of-00005.safetensors").symlink_to(
        target
    )


def two_halves(tensors: dict) -> dict:
    names = sorted(tensors)
    types = [torch.float16, torch.bfloat16]
    return {name: tensors[name].to(types[n % 2]) for n, name in enumerate(names)}


def extra_key(tensors: dict) -> dict:
    return tensors | {"surprise.weight": torch.zeros(2)}


def missing_key(tensors: dict) -> dict:
    return dict(sorted(tensors.items())[1:])


def other_shape(tensors: dict) -> dict:
    name = sorted(tensors)[0]
    return tensors | {name: torch.zeros(*tensors[name].shape, 2)}


def eight_bits(tensors: dict) -> dict:
    return {name: value.to(torch.int8) for name, value in tensors.items()}


def huge_header(folder: Path) -> None:
    shard(folder).write_bytes(struct.pack("<Q", 1 << 62) + b"{}")


def path_in_index(folder: Path) -> None:
    index = folder / "transformer" / "diffusion_pytorch_model.safetensors.index.json"
    edit(index, weight_map={"a": "../../etc/passwd"})


def second_expert_of_another_width(folder: Path) -> None:
    shutil.copytree(folder / "transformer", folder / "transformer_2")
    edit(folder / "transformer_2/config.json", ffn_dim=80)


BAD: dict[str, tuple[Change, str]] = {
    "another architecture": (
        lambda f: edit(f / "transformer/config.json", _class_name="FluxTransformer2DModel"),
        r"expected the architecture WanTransformer3DModel, got 'FluxTransformer2DModel'",
    ),
    "another pipeline": (
        lambda f: edit(f / "model_index.json", _class_name="LTXPipeline"),
        r"expected the architecture WanPipeline",
    ),
    "two experts without a boundary": (
        lambda f: shutil.copytree(f / "transformer", f / "transformer_2"),
        r"expected boundary_ratio to be a number above 0, got None",
    ),
    "two experts that differ": (
        second_expert_of_another_width,
        r"expected the settings of the first expert",
    ),
    "no image encoder": (
        lambda f: edit(f / "transformer/config.json", image_dim=20, added_kv_proj_dim=24),
        r"image_encoder/config\.json: expected a file",
    ),
    "another patch": (
        lambda f: edit(f / "transformer/config.json", patch_size=[2, 2, 2]),
        r"expected patch_size to be \[1, 2, 2\], got \[2, 2, 2\]",
    ),
    "a width that is text": (
        lambda f: edit(f / "transformer/config.json", ffn_dim="40"),
        r"expected ffn_dim to be a whole number above 0",
    ),
    "mixed models": (
        lambda f: edit(f / "text_encoder/config.json", d_model=32),
        r"the folder mixes models",
    ),
    "no statistics": (
        lambda f: edit(f / "vae/config.json", latents_std=[1.0]),
        r"expected latents_std to be 4 numbers",
    ),
    "no index": (
        lambda f: (f / "model_index.json").unlink(),
        r"model_index\.json: expected a file",
    ),
    "no configuration": (lambda f: (f / "vae/config.json").unlink(), r"vae/config\.json"),
    "no tokenizer": (lambda f: shutil.rmtree(f / "tokenizer"), r"tokenizer\.json: expected a file"),
    "configuration cut off": (
        lambda f: (f / "vae/config.json").write_text('{"a": '),
        r"expected a JSON object",
    ),
    "a missing shard": (lambda f: shard(f).unlink(), r"download the model again"),
    "a shard cut off": (half_of_a_shard, r"the file is cut off"),
    "a header without end": (huge_header, r"expected a whole \.safetensors file"),
    "a wrong hash": (wrong_hash, r"expected SHA-256 0000"),
    "a link that leads out": (link_outside, r"got a link to"),
    "a path in the index": (path_in_index, r"expected file names beside it"),
    "two half precisions": (lambda f: rewritten(f, two_halves), r"F16 and BF16 mixed"),
    "whole numbers": (
        lambda f: rewritten(f, eight_bits),
        r"expected weights in F32.*, got I8",
    ),
    "an unknown weight": (lambda f: rewritten(f, extra_key), r"unknown 1 \(surprise\.weight\)"),
    "a missing weight": (lambda f: rewritten(f, missing_key), r"missing 1 \("),
    "another shape": (lambda f: rewritten(f, other_shape), r"wrong shape of 1 \("),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_folders_are_refused_in_words(case: str, folder: Path, tmp_path: Path) -> None:
    change, words = BAD[case]
    change(folder)
    with pytest.raises((CheckpointError, FileFormatError), match=words):
        write_model(open_public_model(folder, settings("t2v")), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_single_precision_may_stand_beside_one_half(folder: Path) -> None:
    def half_of_them(tensors: dict) -> dict:
        return {n: v.bfloat16() if "attn" in n else v for n, v in tensors.items()}

    rewritten(folder, half_of_them)
    summary = open_public_model(folder, settings("t2v")).summary()
    assert "BF16 and F32" in summary


def test_links_of_a_download_cache_are_followed_and_checked(folder: Path, tmp_path: Path) -> None:
    from diff4splat.io.file_digest import file_sha256

    cache = tmp_path / "models--Wan-AI--tiny"
    snapshot = shutil.copytree(folder, cache / "snapshots" / "0123abcd")
    for file in [path for path in snapshot.rglob("*") if path.is_file()]:
        blob = cache / "blobs" / file_sha256(file)
        blob.parent.mkdir(exist_ok=True)
        shutil.move(file, blob)
        file.symlink_to(blob)
    open_public_model(snapshot, settings("t2v"))
    target = shard(snapshot).resolve()
    content = bytearray(target.read_bytes())
    content[-1] ^= 1
    target.write_bytes(content)
    with pytest.raises(FileFormatError, match="the file is damaged"):
        open_public_model(snapshot, settings("t2v"))


@pytest.mark.parametrize("seed", range(20))
def test_random_damage_ends_in_words(seed: int, folder: Path) -> None:
    generator = torch.Generator().manual_seed(seed)
    file = shard(folder)
    content = bytearray(file.read_bytes())
    head = 8 + int.from_bytes(content[:8], "little")
    for place in torch.randint(head, (3,), generator=generator).tolist():
        content[place] ^= 1 << seed % 8
    file.write_bytes(content)
    try:
        open_public_model(folder, settings("t2v"))
    except Diff4SplatError as error:
        assert len(str(error)) < 2000
