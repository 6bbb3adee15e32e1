"""The manifest: written and read again, damaged, and files that are not those it names."""

import json
from pathlib import Path

import pytest

from diff4splat.errors import FileFormatError
from diff4splat.models.onnx.manifest import (
    MANIFEST_FILE,
    GraphEntry,
    Manifest,
    TensorSpec,
    file_entry,
    has_graphs,
    read_manifest,
    require_files,
    write_manifest,
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "config.json").write_text("{}")
    (tmp_path / "depth.onnx").write_bytes(b"graph")
    image = TensorSpec(name="image", dtype="float32", shape=("batch", 3, "16*rows"))
    graph = GraphEntry(
        name="depth",
        part="monocular_depth",
        files=(file_entry(tmp_path / "depth.onnx"),),
        inputs=(image,),
        outputs=(image,),
    )
    manifest = Manifest(
        model="small",
        precision="float32",
        opset=20,
        license="Apache-2.0",
        exported_with={"torch": "2"},
        parameter_counts={"monocular_depth": 5},
        files=(file_entry(tmp_path / "config.json"),),
        graphs=(graph,),
    )
    write_manifest(manifest, tmp_path)
    return tmp_path


def test_written_and_read_again(folder: Path) -> None:
    manifest = read_manifest(folder)
    assert has_graphs(folder) and not has_graphs(folder / "nowhere")
    assert manifest.graph("depth").inputs[0].shape == ("batch", 3, "16*rows")
    assert manifest.of_part("monocular_depth") == manifest.graphs
    assert manifest.weights_sha256() == manifest.weights_sha256(["monocular_depth"])
    assert manifest.weights_sha256([]) != manifest.weights_sha256()
    require_files(folder, [*manifest.files, *manifest.graphs[0].files])


def test_an_unknown_graph_is_named(folder: Path) -> None:
    with pytest.raises(FileFormatError, match="expected a graph 'dit'"):
        read_manifest(folder).graph("dit")


@pytest.mark.parametrize("content", [b"graph\n", b"grapH", b""])
def test_another_file_is_refused(folder: Path, content: bytes) -> None:
    (folder / "depth.onnx").write_bytes(content)
    with pytest.raises(FileFormatError, match="not the one that was exported"):
        require_files(folder, read_manifest(folder).graphs[0].files)


def test_an_absent_file_is_refused(folder: Path) -> None:
    (folder / "depth.onnx").unlink()
    with pytest.raises(FileFormatError, match="expected a file of manifest"):
        require_files(folder, read_manifest(folder).graphs[0].files)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("version", 2),
        ("format", "other"),
        ("precision", "int3"),
        ("graphs", [{"name": "x"}]),
        ("graphs", 3),
        ("files", [{"name": "../config.json", "sha256": "", "bytes": 1}]),
        ("files", [{"name": "/etc/passwd", "sha256": "", "bytes": 1}]),
        ("files", [{"name": "..", "sha256": "", "bytes": 1}]),
        ("files", None),
    ],
)
def test_damage_is_one_error(folder: Path, key: str, value: object) -> None:
    file = folder / MANIFEST_FILE
    file.write_text(json.dumps(json.loads(file.read_text()) | {key: value}))
    with pytest.raises(FileFormatError, match="expected a manifest of ONNX graphs"):
        read_manifest(folder)


def test_a_folder_without_one(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="write them with diff4splat export onnx"):
        read_manifest(tmp_path)
