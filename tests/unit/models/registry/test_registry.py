"""Names, licences, hashes and mirrors of public models."""

import hashlib
from dataclasses import replace
from pathlib import Path

import pytest
from unreliable_server import Behaviour, served

from diff4splat.errors import ConfigError, FileFormatError, InputError
from diff4splat.models.registry.cache import SUMS_FILE, cached_graph, model_folder
from diff4splat.models.registry.catalog import CATALOG, ModelFile, find_model
from diff4splat.models.registry.get import get_model, require_license
from diff4splat.progress.phases import Phases

KNOWN = find_model("depth-anything-v2-small")
FILES = (ModelFile(name="model.onnx", address="https://nowhere.invalid/model.onnx"),)
UNKNOWN = replace(KNOWN, name="mine", files=FILES)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DIFF4SPLAT_CACHE", str(tmp_path / "cache"))
    for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY", "all_proxy"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path / "cache"


def mirror(folder: Path, content: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "mine").mkdir(parents=True, exist_ok=True)
    (folder / "mine" / "model.onnx").write_bytes(content)
    monkeypatch.setenv("DIFF4SPLAT_MIRROR", str(folder))


def test_the_catalogue_is_sound() -> None:
    assert len({model.name for model in CATALOG}) == len(CATALOG)
    for model in CATALOG:
        for file in model.files:
            assert file.address.startswith("https://") and Path(file.name).name == file.name
            assert file.sha256 is None or len(bytes.fromhex(file.sha256)) == 32
        assert model.files[0].name.endswith(".onnx")
    assert CATALOG[0].permissive


def test_restricted_weights_need_consent() -> None:
    restricted = [model for model in CATALOG if not model.permissive]
    assert restricted
    for model in restricted:
        with pytest.raises(ConfigError, match=f"--accept-license.*{model.license}"):
            require_license(model, accepted=False)
        require_license(model, accepted=True)


def test_an_unknown_name_lists_those_that_exist() -> None:
    with pytest.raises(ConfigError, match=r"depth-anything-v2-small.*got 'x'"):
        find_model("x")


def test_the_first_hash_is_recorded_and_trusted(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mirror(tmp_path / "mirror", b"first", monkeypatch)
    lines: list[str] = []
    graph = get_model(UNKNOWN, Phases(), lines.append)
    digest = hashlib.sha256(b"first").hexdigest()
    assert graph.read_bytes() == b"first" and cached_graph(UNKNOWN) == graph
    assert digest in lines[0] and "trusted from now on" in lines[0]
    assert (model_folder(UNKNOWN) / SUMS_FILE).read_text() == f"{digest}  model.onnx\n"
    graph.unlink()
    mirror(tmp_path / "mirror", b"other", monkeypatch)
    with pytest.raises(InputError, match=f"expected a file with SHA-256 {digest}"):
        get_model(UNKNOWN, Phases(), lines.append)
    assert not graph.exists()


def test_what_is_there_is_not_downloaded_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mirror(tmp_path / "mirror", b"first", monkeypatch)
    graph = get_model(UNKNOWN, Phases(), print)
    monkeypatch.setenv("DIFF4SPLAT_MIRROR", str(tmp_path / "absent"))
    assert get_model(UNKNOWN, Phases(), print) == graph
    graph.write_bytes(b"damaged")
    with pytest.raises(InputError, match="expected a file of the mirror"):
        get_model(UNKNOWN, Phases(), print)


def test_a_mirror_may_be_a_web_address(monkeypatch: pytest.MonkeyPatch) -> None:
    with served(Behaviour(b"content")) as address:
        monkeypatch.setenv("DIFF4SPLAT_MIRROR", address.rsplit("/", 1)[0] + "/")
        assert get_model(UNKNOWN, Phases(), print).read_bytes() == b"content"


def test_a_damaged_list_of_hashes_is_refused(cache: Path) -> None:
    folder = model_folder(UNKNOWN)
    folder.mkdir(parents=True)
    (folder / SUMS_FILE).write_text("../../x\n")
    with pytest.raises(FileFormatError, match="expected lines of a hash and a name"):
        get_model(UNKNOWN, Phases(), print)


def test_a_model_that_was_not_downloaded_says_how() -> None:
    with pytest.raises(ConfigError, match="diff4splat models get depth-anything-v2-small"):
        cached_graph(KNOWN)
