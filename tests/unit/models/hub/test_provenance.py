import json
from pathlib import Path

import pytest

from diff4splat.errors import CheckpointError
from diff4splat.models.hub.provenance import (
    NOT_STATED,
    PROVENANCE_FILE,
    ModelProvenance,
    read_provenance,
    write_provenance,
)
from diff4splat.models.networks import PARTS


def written(folder: Path, content: object) -> Path:
    text = content if isinstance(content, str) else json.dumps(content)
    (folder / PROVENANCE_FILE).write_text(text, encoding="utf-8")
    return folder


def test_what_is_written_is_read(tmp_path: Path) -> None:
    given = ModelProvenance(
        trained=frozenset({"ldrm", "vae"}), license="CC-BY-4.0", origin="worlds → weights"
    )
    write_provenance(given, tmp_path)
    found = read_provenance(tmp_path)
    assert (found.trained, found.license, found.origin) == (
        given.trained,
        "CC-BY-4.0",
        "worlds → weights",
    )
    assert found.may_lack == set(PARTS) - given.trained


def test_the_file_lists_parts_in_one_order(tmp_path: Path) -> None:
    write_provenance(ModelProvenance(trained=frozenset(PARTS)), tmp_path)
    assert json.loads((tmp_path / PROVENANCE_FILE).read_text()) == {
        "format": "diff4splat-model",
        "version": 2,
        "trained": [
            "vae",
            "text_encoder",
            "dit",
            "ldrm",
            "deformation",
            "monocular_depth",
            "motion_unet",
            "image_encoder",
            "object_mask",
            "image_classifier",
            "image_inpainting",
            "object_shadow",
        ],
        "license": "not stated",
        "origin": "not stated",
    }


@pytest.mark.parametrize("version", [{}, {"version": 1}, {"version": 1, "format": "x"}])
@pytest.mark.parametrize("untrained", [True, False])
def test_version_1_is_all_or_nothing_and_lacks_no_part(
    tmp_path: Path, version: dict[str, object], untrained: bool
) -> None:
    found = read_provenance(written(tmp_path, version | {"untrained": untrained}))
    assert found.trained == (frozenset() if untrained else frozenset(PARTS))
    assert found.may_lack == frozenset()
    assert (found.license, found.origin) == (NOT_STATED, NOT_STATED)


def test_without_a_file_nothing_is_trained_and_nothing_may_lack(tmp_path: Path) -> None:
    assert read_provenance(tmp_path) == ModelProvenance()
    assert ModelProvenance().may_lack == frozenset()


def test_nothing_trained_may_be_said_too(tmp_path: Path) -> None:
    found = read_provenance(written(tmp_path, {"version": 2, "trained": []}))
    assert found.trained == frozenset()
    assert found.may_lack == frozenset(PARTS)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        "[" * 100_000,
        "[]",
        "null",
        '"text"',
        {},
        {"version": 2},
        {"version": 1, "trained": []},
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, content: object) -> None:
    with pytest.raises(CheckpointError, match=r"provenance\.json: expected a JSON object"):
        read_provenance(written(tmp_path, content))


@pytest.mark.parametrize("trained", ["vae", None, 3, ["vae", "head"], [["vae"]], {"vae": 1}])
def test_parts_that_do_not_exist_are_refused(tmp_path: Path, trained: object) -> None:
    with pytest.raises(CheckpointError, match="'trained'"):
        read_provenance(written(tmp_path, {"version": 2, "trained": trained}))


@pytest.mark.parametrize("version", [0, 3, "2", None])
def test_other_versions_are_refused(tmp_path: Path, version: object) -> None:
    with pytest.raises(CheckpointError, match=r"expected version 1 or 2, got .*newer"):
        read_provenance(written(tmp_path, {"version": version, "trained": []}))
