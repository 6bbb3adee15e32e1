import json
from pathlib import Path

import pytest
import torch
from packed_models import TRAINED, packed_folder, random_model, trained_folder
from safetensors.torch import load_file

from diff4splat.errors import CheckpointError, ConfigError
from diff4splat.models.hub.export import Packed, export_model
from diff4splat.models.hub.model import Model, load_model
from diff4splat.models.hub.weight_files import part_file, weights_sha256

FILES = {"config.json", "provenance.json", "SHA256SUMS"}


@pytest.fixture
def model(tmp_path: Path) -> Model:
    return load_model(trained_folder(tmp_path / "run-model"))


def pack(model: Model, folder: Path, parts: tuple[str, ...] | None = None) -> Packed:
    return export_model(model, folder, license="MIT", origin="made by a test", parts=parts)


def names(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir()}


def test_only_trained_parts_in_half_precision(model: Model, tmp_path: Path) -> None:
    packed = pack(model, tmp_path / "packed")
    assert names(tmp_path / "packed") == FILES | {f"{part}.safetensors" for part in TRAINED}
    for part in TRAINED:
        file = part_file(tmp_path / "packed", part)
        stored = load_file(file)
        assert {value.dtype for value in stored.values()} == {torch.float16}
        for key, value in getattr(model.networks, part).state_dict().items():
            assert torch.equal(stored[key], value.half()), key
        assert packed.bytes_by_part[part] == file.stat().st_size
    assert packed.bytes_by_part.keys() == set(TRAINED)
    assert packed.weights_sha256 == weights_sha256(tmp_path / "packed")


def test_packing_twice_gives_equal_bytes(model: Model, tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    pack(model, first)
    pack(model, second)
    for name in names(first):
        assert (first / name).read_bytes() == (second / name).read_bytes()


def test_packing_what_is_packed_changes_no_weight(model: Model, tmp_path: Path) -> None:
    first = pack(model, tmp_path / "first")
    again = pack(load_model(tmp_path / "first"), tmp_path / "second")
    assert again.weights_sha256 == first.weights_sha256


def test_provenance_says_what_was_packed(model: Model, tmp_path: Path) -> None:
    pack(model, tmp_path / "packed")
    record = json.loads((tmp_path / "packed" / "provenance.json").read_text())
    assert record["trained"] == list(TRAINED)
    assert (record["license"], record["origin"]) == ("MIT", "made by a test")


def test_named_parts_count_as_trained(model: Model, tmp_path: Path) -> None:
    packed = pack(model, tmp_path / "packed", ("text_encoder", "vae"))
    assert packed.bytes_by_part.keys() == {"text_encoder", "vae"}
    assert load_model(tmp_path / "packed").trained == {"text_encoder", "vae"}


def test_nothing_trained_is_nothing_to_pack(model: Model, tmp_path: Path) -> None:
    folder = trained_folder(tmp_path / "fresh", ())
    for parts in (None, ()):
        with pytest.raises(ConfigError, match="expected trained parts, got none"):
            pack(load_model(folder), tmp_path / "packed", parts)
    assert not (tmp_path / "packed").exists()


def test_random_weights_are_not_packed(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"part 'vae': expected weights .*, got none"):
        pack(random_model(), tmp_path / "packed", ("vae",))
    with pytest.raises(ConfigError, match=r"part 'dit': expected weights .*, got none"):
        pack(load_model(packed_folder(tmp_path)), tmp_path / "packed", ("vae", "dit"))


@pytest.mark.parametrize("value", [65520.0, -1e30, float("nan")])
def test_what_half_precision_cannot_hold_is_refused(
    model: Model, tmp_path: Path, value: float
) -> None:
    pack(model, tmp_path / "packed")
    before = {name: (tmp_path / "packed" / name).read_bytes() for name in FILES}
    model.networks.ldrm.to_gaussians.bias.data[3] = value
    with pytest.raises(
        CheckpointError, match=r"ldrm weights: .*at most 65504 in to_gaussians\.bias"
    ):
        pack(model, tmp_path / "packed")
    assert {name: (tmp_path / "packed" / name).read_bytes() for name in FILES} == before
    assert not list((tmp_path / "packed").glob(".partial*"))


def test_the_largest_half_is_fine_and_so_is_a_bad_part_that_stays_out(
    model: Model, tmp_path: Path
) -> None:
    model.networks.ldrm.to_gaussians.bias.data[3] = 65504.0
    model.networks.dit.head.bias.data[:] = 1e30
    pack(model, tmp_path / "packed")
    loaded = load_model(tmp_path / "packed")
    assert loaded.networks.ldrm.to_gaussians.bias.data[3] == 65504.0


def test_packing_anew_removes_old_parts_and_keeps_the_card(model: Model, tmp_path: Path) -> None:
    folder = tmp_path / "packed"
    pack(model, folder, ("vae", "dit"))
    (folder / "CARD.md").write_text("about these weights")
    pack(model, folder)
    assert not part_file(folder, "dit").exists()
    assert (folder / "CARD.md").read_text() == "about these weights"
    assert load_model(folder).trained == set(TRAINED)
