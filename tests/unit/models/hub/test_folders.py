"""Which folder a name means, and what it says without any weights."""

import json
from pathlib import Path

import pytest
from packed_models import TRAINED, packed_folder, ship, trained_folder

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.models.config.sizes import small_size
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.hub import bundled_weights
from diff4splat.models.hub.checksums import write_sums
from diff4splat.models.hub.folders import checked_folder, find_config, find_provenance
from diff4splat.models.hub.model import load_model
from diff4splat.models.hub.model_info import model_info
from diff4splat.models.hub.provenance import ModelProvenance
from diff4splat.models.hub.weight_files import part_file, weights_sha256
from diff4splat.models.networks import model_parts


def test_a_model_folder_of_that_name_comes_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ship(tmp_path, monkeypatch)
    trained_folder(tmp_path / "mine" / "test")
    monkeypatch.chdir(tmp_path / "mine")
    assert checked_folder("test") == Path("test")
    assert load_model("test", parts=("vae",)).folder == Path("test")


def test_another_folder_of_that_name_hides_no_bundled_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "small").mkdir()
    (tmp_path / "small" / "notes.txt").write_text("results of an experiment")
    monkeypatch.chdir(tmp_path)
    bundled = bundled_weights.WEIGHTS_FOLDER / "small"
    assert checked_folder("small", ("config.json",)) == bundled
    assert find_config("small") == small_size()
    assert load_model("small", parts=("deformation",)).folder == bundled


def test_another_folder_of_that_name_hides_no_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "test").mkdir()
    monkeypatch.chdir(tmp_path)
    assert load_model("test", parts=()).folder is None


@pytest.mark.parametrize("name", ["", "x" * 5000, "huge", "../small"])
def test_a_name_that_means_nothing(name: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="expected test, small, paper"):
        find_config(name if name else str(tmp_path / "nowhere"))


@pytest.mark.parametrize("read", [model_info, find_config, find_provenance])
def test_a_damaged_configuration_says_install_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: object
) -> None:
    file = ship(tmp_path, monkeypatch) / "config.json"
    file.write_bytes(file.read_bytes() + b" ")
    with pytest.raises(FileFormatError, match=r"config\.json: .*; .*install diff4splat again"):
        read("test")


@pytest.mark.parametrize("change", ["changed", "gone"])
def test_facts_of_a_model_compare_every_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str
) -> None:
    file = ship(tmp_path, monkeypatch) / "ldrm.safetensors"
    file.write_bytes(file.read_bytes() + b" ") if change == "changed" else file.unlink()
    with pytest.raises(FileFormatError, match=r"ldrm\.safetensors: .*install diff4splat again"):
        model_info("test")
    assert find_config("test") == tiny_size()


def test_the_configuration_is_that_of_the_bundled_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = ship(tmp_path, monkeypatch)
    config = json.loads((folder / "config.json").read_text()) | {"frames": 9}
    (folder / "config.json").write_text(json.dumps(config))
    write_sums(folder)
    assert find_config("test").frames == load_model("test", parts=()).config.frames == 9


def test_what_is_trained_is_known_without_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = ship(tmp_path, monkeypatch)
    for part in TRAINED:
        part_file(folder, part).write_bytes(b"")
    assert find_provenance("test").trained == set(TRAINED)
    assert find_provenance("paper") == ModelProvenance()


def test_facts_of_random_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bundled_weights, "WEIGHTS_FOLDER", tmp_path)
    facts = model_info("test")
    assert facts.states == dict.fromkeys(model_parts(tiny_size()), "random")
    assert facts.weights_sha256 == "none"


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
    assert (facts.location, facts.weights_sha256) == (str(folder), weights_sha256(folder))
    assert (facts.config, facts.provenance.license) == (tiny_size(), "MIT")
    (folder / "SHA256SUMS").unlink()
    part_file(folder, "vae").unlink()
    assert model_info(folder).states["vae"] == "missing"


def test_a_part_with_weights_that_nobody_finished_is_untrained(tmp_path: Path) -> None:
    folder = trained_folder(tmp_path / "model")
    assert model_info(folder).states["dit"] == "untrained"
