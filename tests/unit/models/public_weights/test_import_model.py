"""An imported folder: the bytes of the weights, what is trained, and how it is loaded."""

import weakref
from pathlib import Path

import pytest
import torch
import wan_folder
from imported_models import settings
from safetensors.torch import load_file
from torch import nn
from torch.func import functional_call

from diff4splat.errors import FileFormatError
from diff4splat.models.adapters.tuning import ADDED
from diff4splat.models.blocks import streamed_block
from diff4splat.models.hub.mapped_weights import resident_bytes
from diff4splat.models.hub.model import load_model
from diff4splat.models.public_weights.import_model import open_public_model, write_model
from diff4splat.models.video_dit.conditions import RenderCondition
from diff4splat.models.wan.key_map import video_dit_key


def test_weights_are_copied_bit_by_bit(wan_source: Path, imported: dict[str, Path]) -> None:
    ours, theirs = load_file(imported["t2v"] / "dit.safetensors"), {}
    for shard in (wan_source / "transformer").glob("*.safetensors"):
        theirs |= load_file(shard)
    for key, value in theirs.items():
        assert torch.equal(ours.pop(video_dit_key(key)).flatten(), value.flatten())
    assert ours and all(key.startswith(ADDED) for key in ours)


def test_half_precision_stays_as_it_is_stored(tmp_path: Path) -> None:
    source = wan_folder.write_wan(tmp_path / "source", dtype=torch.bfloat16)
    write_model(open_public_model(source, settings("t2v")), tmp_path / "model")
    stored = load_file(tmp_path / "model" / "dit.safetensors")
    assert stored["blocks.0.attention.to_query.weight"].dtype == torch.bfloat16
    dit = load_model(tmp_path / "model", parts=("dit",)).networks.dit
    block = dit.blocks[0].block
    assert block.attention.to_query.weight.dtype == torch.bfloat16
    assert dit.head.weight.dtype == torch.float32


def test_only_what_lies_outside_the_blocks_takes_memory(imported: dict[str, Path]) -> None:
    networks = load_model(imported["t2v"], parts=("dit", "text_encoder")).networks
    for part in (networks.dit, networks.text_encoder):
        whole = sum(value.nbytes for value in part.state_dict().values())
        blocks = sum(v.nbytes for k, v in part.state_dict().items() if k.startswith("blocks."))
        assert resident_bytes(part) <= whole - blocks


@torch.no_grad()
def test_memory_holds_one_block_in_full(
    imported: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    dit = load_model(imported["t2v"], parts=("dit",)).networks.dit.to(torch.float64)
    copies: list[weakref.ref] = []
    alive: list[int] = []

    def recording(block: nn.Module, weights: dict, inputs: tuple) -> torch.Tensor:
        copies.extend(map(weakref.ref, weights.values()))
        alive.append(sum(copy().nbytes for copy in copies if copy() is not None))
        return functional_call(block, weights, inputs)

    monkeypatch.setattr(streamed_block, "functional_call", recording)
    latent = torch.randn(1, 4, 1, 2, 2, dtype=torch.float64)
    validity = torch.ones(1, 1, 1, 16, 16, dtype=torch.float64)
    text = torch.randn(1, 2, wan_folder.TEXT_WIDTH, dtype=torch.float64)
    level = torch.rand(1, 1, dtype=torch.float64)
    condition = RenderCondition(latent=latent, validity=validity)
    dit(latent, level, text=text, condition=condition)
    block = sum(2 * value.nbytes for value in dit.blocks[0].block.parameters())
    assert alive == [block, block]
    assert dit.blocks[0].block.attention.to_query.weight.dtype == torch.float32, "stored unchanged"


def test_provenance_says_what_is_public_and_what_is_not(imported: dict[str, Path]) -> None:
    model = load_model(imported["t2v"], parts=())
    assert model.trained == {"vae", "text_encoder", "dit"}
    assert model.origin == "imported from source"


@pytest.mark.parametrize("name", ["dit.safetensors", "tokenizer.json"])
def test_a_changed_file_is_refused(name: str, wan_source: Path, tmp_path: Path) -> None:
    write_model(open_public_model(wan_source, settings("t2v")), tmp_path / "model")
    file = tmp_path / "model" / name
    content = bytearray(file.read_bytes())
    content[-2] ^= 1
    file.write_bytes(content)
    with pytest.raises(FileFormatError, match="damaged"):
        load_model(tmp_path / "model", parts=("dit", "text_encoder"))


def test_importing_again_replaces_the_folder_as_a_whole(wan_source: Path, tmp_path: Path) -> None:
    for _ in range(2):
        write_model(open_public_model(wan_source, settings("t2v")), tmp_path / "model")
    names = {file.name for file in (tmp_path / "model").iterdir()}
    assert {"dit.safetensors", "tokenizer.json", "SHA256SUMS", "config.json"} <= names
