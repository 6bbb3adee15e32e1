"""Loading and saving: which networks are read, which are random, what a model says of itself."""

import json
from pathlib import Path

import pytest
import torch
from packed_models import TRAINED, packed_folder, random_model, ship, trained_folder
from safetensors.torch import load_file, save_file
from torch import nn

from diff4splat.errors import CheckpointError, ConfigError, FileFormatError, OutputError
from diff4splat.models.config.sizes import paper_size
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub import bundled_weights
from diff4splat.models.hub.checksums import write_sums
from diff4splat.models.hub.model import Model, load_model, model_device, save_model, with_parts
from diff4splat.models.hub.weight_files import part_file, weights_sha256
from diff4splat.models.networks import Networks, model_parts

PARTS = model_parts(tiny_size())


def assert_same(left: nn.Module, right: dict[str, torch.Tensor]) -> None:
    found = left.state_dict()
    assert found.keys() == right.keys()
    for key, value in right.items():
        assert torch.equal(found[key], value.float()), key


def damage(folder: Path, part: str, kind: str) -> None:
    """Spoil the weights of one part; the list of checksums is that of the spoilt file."""
    file = part_file(folder, part)
    if kind == "nan":
        tensors = load_file(file)
        save_file(
            {key: torch.full_like(value, float("nan")) for key, value in tensors.items()}, file
        )
    else:
        file.write_bytes(file.read_bytes()[:-9])
    write_sums(folder)


@pytest.fixture
def no_bundle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bundled_weights, "WEIGHTS_FOLDER", tmp_path / "nowhere")


@pytest.mark.usefixtures("no_bundle")
def test_a_size_without_bundled_weights_is_random() -> None:
    model = load_model("test")
    assert (model.folder, model.weights_sha256(), model.trained) == (None, "none", frozenset())
    assert model.loaded == set(PARTS) == set(model.parts)
    for name, part in create_networks(tiny_size()).parts():
        assert_same(getattr(model.networks, name), part.state_dict())


@pytest.mark.usefixtures("no_bundle")
def test_random_parts_do_not_depend_on_which_are_asked_for() -> None:
    model = load_model("test", parts=("dit",))
    assert model.loaded == {"dit"}
    assert_same(model.networks.dit, create_networks(tiny_size()).dit.state_dict())
    more = with_parts(model, ("dit", "vae"))
    assert more.networks.dit is model.networks.dit
    assert_same(more.networks.vae, create_networks(tiny_size()).vae.state_dict())


def test_a_size_with_bundled_weights_has_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = ship(tmp_path, monkeypatch)
    model = load_model("test")
    assert model.folder == folder
    assert model.weights_sha256() == weights_sha256(folder)
    assert model.weights_sha256(("vae",)) == weights_sha256(folder, ("vae",))
    assert model.trained == set(TRAINED)
    assert (model.license, model.origin) == ("MIT", "made by a test")
    for part in TRAINED:
        assert_same(getattr(model.networks, part), load_file(part_file(folder, part)))
    assert {value.dtype for value in model.networks.ldrm.parameters()} == {torch.float32}


def test_parts_without_a_file_are_the_random_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ship(tmp_path, monkeypatch)
    networks = load_model("test").networks
    for part in ("dit", "text_encoder"):
        reference = getattr(create_networks(tiny_size()), part)
        assert_same(getattr(networks, part), reference.state_dict())
    assert not any(value.is_meta for _, part in networks.parts() for value in part.buffers())


def test_bundled_parts_are_all_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = ship(tmp_path, monkeypatch, PARTS)
    model = load_model("test")
    for part in PARTS:
        assert_same(getattr(model.networks, part), load_file(part_file(folder, part)))


def test_other_sizes_stay_random(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ship(tmp_path, monkeypatch)
    assert load_model("small", parts=("vae",)).folder is None
    (tmp_path / "weights" / "huge").mkdir()
    with pytest.raises(ConfigError, match="expected test, small, paper, got 'huge'"):
        load_model("huge")
    with pytest.raises(ConfigError, match="network size"):
        load_model("../weights/test")


@pytest.mark.usefixtures("no_bundle")
def test_a_model_larger_than_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.sysconf", lambda _: 1 << 16)
    with pytest.raises(ConfigError, match=r"model 'paper': expected at least \d+ GiB of memory"):
        load_model("paper", parts=("vae", "dit"))
    assert load_model("paper", parts=()).config == paper_size()


@pytest.mark.parametrize("kind", ["nan", "cut"])
def test_only_the_files_of_asked_parts_are_read(tmp_path: Path, kind: str) -> None:
    folder = packed_folder(tmp_path)
    damage(folder, "ldrm", kind)
    model = load_model(folder, parts=("vae", "deformation"))
    assert model.loaded == {"vae", "deformation"} and model.networks.ldrm is None
    for load in (lambda: load_model(folder, parts=("ldrm",)), lambda: with_parts(model, ("ldrm",))):
        with pytest.raises((CheckpointError, FileFormatError), match="ldrm"):
            load()


def test_only_the_checksums_of_asked_parts_are_compared(tmp_path: Path) -> None:
    folder = packed_folder(tmp_path)
    file = part_file(folder, "ldrm")
    file.write_bytes(file.read_bytes() + b" ")
    assert load_model(folder, parts=("vae",)).loaded == {"vae"}
    with pytest.raises(FileFormatError, match=r"ldrm\.safetensors: expected SHA-256"):
        load_model(folder, parts=("vae", "ldrm"))


def test_no_weights_are_read_where_no_part_is_asked_for(tmp_path: Path) -> None:
    folder = packed_folder(tmp_path)
    for part in TRAINED:
        part_file(folder, part).write_bytes(b"")
    model = load_model(folder, parts=())
    assert (model.loaded, model.trained) == (frozenset(), set(TRAINED))
    assert model_device(model) == torch.device("cpu")


def test_loaded_networks_are_shared(tmp_path: Path) -> None:
    model = load_model(packed_folder(tmp_path), parts=("vae",))
    assert with_parts(model, ("vae",)) is model
    more = with_parts(model, ("ldrm", "motion_unet"))
    assert more.loaded == {"vae", "ldrm"}
    assert more.networks.vae is model.networks.vae
    assert model.networks.ldrm is None


@pytest.mark.parametrize("name", ["config.json", "provenance.json", "ldrm.safetensors"])
@pytest.mark.parametrize("change", ["changed", "gone"])
def test_a_damaged_installation_says_install_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, change: str
) -> None:
    file = ship(tmp_path, monkeypatch) / name
    file.write_bytes(file.read_bytes() + b" ") if change == "changed" else file.unlink()
    with pytest.raises(FileFormatError, match=rf"{name}: .*; .*install diff4splat again"):
        load_model("test")


def test_bundled_weights_without_checksums_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (ship(tmp_path, monkeypatch) / "SHA256SUMS").unlink()
    with pytest.raises(FileFormatError, match=r"SHA256SUMS: .*install diff4splat again"):
        load_model("test")


def test_other_folders_need_no_checksums_but_they_are_compared(tmp_path: Path) -> None:
    folder = packed_folder(tmp_path)
    (folder / "config.json").write_text((folder / "config.json").read_text() + "\n")
    with pytest.raises(FileFormatError, match="fetch the model again"):
        load_model(folder)
    (folder / "SHA256SUMS").unlink()
    assert load_model(folder).trained == set(TRAINED)


def test_trained_parts_must_have_a_file(tmp_path: Path) -> None:
    folder = trained_folder(tmp_path / "model")
    part_file(folder, "dit").unlink()
    part_file(folder, "text_encoder").unlink()
    assert load_model(folder).trained == set(TRAINED)
    part_file(folder, "ldrm").unlink()
    with pytest.raises(CheckpointError, match=r"ldrm\.safetensors: expected a weight file, got no"):
        load_model(folder)


@pytest.mark.parametrize("provenance", [None, {"version": 1, "untrained": True}])
def test_without_a_list_of_trained_parts_all_must_have_a_file(
    tmp_path: Path, provenance: dict[str, object] | None
) -> None:
    folder = trained_folder(tmp_path / "model")
    (folder / "provenance.json").unlink()
    if provenance is not None:
        (folder / "provenance.json").write_text(json.dumps(provenance))
    assert load_model(folder).trained == frozenset()
    part_file(folder, "text_encoder").unlink()
    assert load_model(folder, parts=TRAINED).loaded == set(TRAINED)
    with pytest.raises(CheckpointError, match="text_encoder"):
        load_model(folder)


def test_version_1_of_the_provenance_trains_no_part_that_the_model_lacks(tmp_path: Path) -> None:
    folder = trained_folder(tmp_path / "model")
    (folder / "provenance.json").write_text(json.dumps({"version": 1, "untrained": False}))
    assert load_model(folder).trained == set(PARTS)


def test_files_of_untrained_parts_are_read(tmp_path: Path) -> None:
    folder = trained_folder(tmp_path / "model", PARTS)
    record = json.loads((folder / "provenance.json").read_text()) | {"trained": ["vae"]}
    (folder / "provenance.json").write_text(json.dumps(record))
    model = load_model(folder)
    for part in ("dit", "text_encoder"):
        assert_same(getattr(model.networks, part), load_file(part_file(folder, part)))


def test_saving_keeps_what_is_known(tmp_path: Path) -> None:
    save_model(load_model(packed_folder(tmp_path)), tmp_path / "copy")
    found = load_model(tmp_path / "copy")
    assert (found.trained, found.license, found.origin) == (set(TRAINED), "MIT", "made by a test")


def test_saving_writes_parts_that_are_not_loaded_too(tmp_path: Path) -> None:
    folder = packed_folder(tmp_path)
    save_model(load_model(folder, parts=("vae",)), tmp_path / "copy")
    assert all(part_file(tmp_path / "copy", part).is_file() for part in PARTS)
    assert_same(load_model(tmp_path / "copy").networks.ldrm, load_file(part_file(folder, "ldrm")))


def test_saving_over_a_packed_model_leaves_a_sound_folder(tmp_path: Path) -> None:
    folder = packed_folder(tmp_path)
    save_model(load_model(tmp_path / "run-model"), folder)
    assert load_model(folder).trained == set(TRAINED)


def test_a_file_in_the_way_of_saving(tmp_path: Path) -> None:
    (tmp_path / "model").write_text("")
    with pytest.raises(OutputError, match="a file stands where a folder is needed"):
        save_model(random_model(), tmp_path / "model")


def test_the_device_is_that_of_the_networks() -> None:
    networks = Networks(vae=create_networks(tiny_size(), "meta", parts=("vae",)).vae)
    assert model_device(Model(config=tiny_size(), networks=networks)).type == "meta"
