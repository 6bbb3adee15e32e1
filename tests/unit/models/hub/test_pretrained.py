"""Which weights a name means, which parts may be absent, and what a model says of itself."""

import json
import shutil
from pathlib import Path

import pytest
import torch
from packed_models import TRAINED, as_trained, packed_folder, random_model, ship, trained_folder
from safetensors.torch import load_file
from torch import nn

from diff4splat.errors import CheckpointError, ConfigError, FileFormatError, OutputError
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import PARTS, create_networks, create_text_encoder
from diff4splat.models.hub import bundled_weights as shipped
from diff4splat.models.hub.checksums import write_sums
from diff4splat.models.hub.model_info import model_info
from diff4splat.models.hub.pretrained import find_config, load_model, save_model, with_text_encoder
from diff4splat.models.hub.weights import part_file, weights_sha256


def assert_same(left: nn.Module, right: dict[str, torch.Tensor]) -> None:
    found = left.state_dict()
    assert found.keys() == right.keys()
    for key, value in right.items():
        assert torch.equal(found[key], value.float()), key


@pytest.fixture
def nothing_ships(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shipped, "WEIGHTS_FOLDER", tmp_path / "nowhere")


@pytest.mark.usefixtures("nothing_ships")
def test_a_size_without_shipped_weights_is_random() -> None:
    model = load_model("test")
    assert (model.folder, model.weights_sha256, model.trained) == (None, "none", frozenset())
    assert model.untrained and model.runs_video_model
    fresh = create_networks(tiny_size(), with_text=False)
    for name, part in fresh.parts():
        assert_same(getattr(model.networks, name), part.state_dict())
    assert model_info("test").states == dict.fromkeys(PARTS, "random")


def test_a_size_with_shipped_weights_has_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = ship(tmp_path, monkeypatch)
    model = load_model("test")
    assert model.folder == folder
    assert model.weights_sha256 == weights_sha256(folder)
    assert model.trained == set(TRAINED)
    assert (model.license, model.origin) == ("MIT", "made by a test")
    for part in TRAINED:
        assert_same(getattr(model.networks, part), load_file(part_file(folder, part)))
    assert {value.dtype for value in model.networks.ldrm.parameters()} == {torch.float32}


def test_parts_that_do_not_ship_are_the_random_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ship(tmp_path, monkeypatch)
    model = with_text_encoder(load_model("test"))
    assert_same(model.networks.dit, create_networks(tiny_size()).dit.state_dict())
    assert_same(model.networks.text_encoder, create_text_encoder(tiny_size()).state_dict())
    assert not any(value.is_meta for _, part in model.networks.parts() for value in part.buffers())


def test_a_part_that_ships_later_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = ship(tmp_path, monkeypatch, PARTS)
    model = with_text_encoder(load_model("test"))
    assert not model.untrained
    for part in PARTS:
        assert_same(getattr(model.networks, part), load_file(part_file(folder, part)))


def test_other_sizes_stay_random(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ship(tmp_path, monkeypatch)
    assert load_model("small").folder is None
    (tmp_path / "weights" / "huge").mkdir()
    with pytest.raises(ConfigError, match="expected test, small, paper, got 'huge'"):
        load_model("huge")
    with pytest.raises(ConfigError, match="network size"):
        load_model("../weights/test")


def test_a_folder_of_that_name_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ship(tmp_path, monkeypatch)
    trained_folder(tmp_path / "mine" / "test", PARTS)
    monkeypatch.chdir(tmp_path / "mine")
    assert load_model("test").folder == Path("test")


@pytest.mark.parametrize("name", ["config.json", "provenance.json", "ldrm.safetensors"])
@pytest.mark.parametrize("damage", ["changed", "gone"])
def test_a_damaged_installation_says_install_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, damage: str
) -> None:
    file = ship(tmp_path, monkeypatch) / name
    file.write_bytes(file.read_bytes() + b" ") if damage == "changed" else file.unlink()
    for read in (load_model, model_info):
        with pytest.raises(FileFormatError, match=rf"{name}: .*; .*install diff4splat again"):
            read("test")
    if name == "config.json":
        with pytest.raises(FileFormatError, match="install diff4splat again"):
            find_config("test")


def test_shipped_weights_without_checksums_are_not_trusted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (ship(tmp_path, monkeypatch) / "SHA256SUMS").unlink()
    with pytest.raises(FileFormatError, match=r"SHA256SUMS: .*install diff4splat again"):
        load_model("test")


def test_a_folder_of_ones_own_needs_no_checksums_but_they_are_checked(tmp_path: Path) -> None:
    folder = packed_folder(tmp_path)
    (folder / "config.json").write_text((folder / "config.json").read_text() + "\n")
    with pytest.raises(FileFormatError, match="fetch the model again"):
        load_model(folder)
    (folder / "SHA256SUMS").unlink()
    assert load_model(folder).trained == set(TRAINED)


def test_the_configuration_is_that_of_the_shipped_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = ship(tmp_path, monkeypatch)
    config = json.loads((folder / "config.json").read_text()) | {"frames": 9}
    (folder / "config.json").write_text(json.dumps(config))
    write_sums(folder)
    assert find_config("test").frames == load_model("test").config.frames == 9


def test_trained_parts_must_be_there(tmp_path: Path) -> None:
    folder = trained_folder(tmp_path / "model")
    part_file(folder, "dit").unlink()
    part_file(folder, "text_encoder").unlink()
    assert load_model(folder).trained == set(TRAINED)
    part_file(folder, "ldrm").unlink()
    with pytest.raises(CheckpointError, match=r"ldrm\.safetensors: expected a weight file, got no"):
        load_model(folder)


@pytest.mark.parametrize("provenance", [None, {"version": 1, "untrained": True}])
def test_without_a_list_of_trained_parts_all_must_be_there(
    tmp_path: Path, provenance: dict[str, object] | None
) -> None:
    folder = trained_folder(tmp_path / "model")
    (folder / "provenance.json").unlink()
    if provenance is not None:
        (folder / "provenance.json").write_text(json.dumps(provenance))
    assert load_model(folder).trained == frozenset()
    part_file(folder, "text_encoder").unlink()
    with pytest.raises(CheckpointError, match="text_encoder"):
        with_text_encoder(load_model(folder))
    part_file(folder, "dit").unlink()
    with pytest.raises(CheckpointError, match="dit"):
        load_model(folder)


def test_untrained_parts_that_lie_there_are_read(tmp_path: Path) -> None:
    folder = trained_folder(tmp_path / "model", PARTS)
    record = json.loads((folder / "provenance.json").read_text()) | {"trained": ["vae"]}
    (folder / "provenance.json").write_text(json.dumps(record))
    model = with_text_encoder(load_model(folder))
    for part in ("dit", "text_encoder"):
        assert_same(getattr(model.networks, part), load_file(part_file(folder, part)))
    assert model_info(folder).states["dit"] == "untrained"


def test_saving_keeps_what_is_known(tmp_path: Path) -> None:
    given = load_model(packed_folder(tmp_path))
    save_model(given, tmp_path / "copy")
    found = load_model(tmp_path / "copy")
    assert (found.trained, found.license, found.origin) == (set(TRAINED), "MIT", "made by a test")
    assert {part_file(tmp_path / "copy", part).is_file() for part in PARTS} == {True}


def test_saving_over_a_packed_model_leaves_a_sound_folder(tmp_path: Path) -> None:
    folder = packed_folder(tmp_path)
    save_model(load_model(tmp_path / "run-model"), folder)
    assert load_model(folder).trained == set(TRAINED)


def test_a_file_in_the_way_of_saving(tmp_path: Path) -> None:
    (tmp_path / "model").write_text("")
    with pytest.raises(OutputError, match="a file stands where a folder is needed"):
        save_model(random_model(), tmp_path / "model")


@pytest.mark.parametrize(
    ("trained", "untrained", "runs"),
    [
        ((), True, True),
        (("vae",), True, False),
        (TRAINED, True, False),
        (("vae", "dit"), True, True),
        ((*TRAINED, "dit"), True, True),
        (PARTS, False, True),
    ],
)
def test_what_a_model_can_do(trained: tuple[str, ...], untrained: bool, runs: bool) -> None:
    model = as_trained(random_model(), *trained)
    assert (model.untrained, model.runs_video_model) == (untrained, runs)


def test_facts_of_a_folder(tmp_path: Path) -> None:
    folder = packed_folder(tmp_path)
    facts = model_info(folder)
    assert facts.states == {
        "vae": "trained",
        "text_encoder": "random",
        "dit": "random",
        "ldrm": "trained",
        "deformation": "trained",
    }
    assert (facts.place, facts.weights_sha256) == (str(folder), weights_sha256(folder))
    assert (facts.config, facts.provenance.license) == (tiny_size(), "MIT")
    shutil.copy(part_file(folder, "vae"), tmp_path / "kept")
    (folder / "SHA256SUMS").unlink()
    part_file(folder, "vae").unlink()
    assert model_info(folder).states["vae"] == "missing"
