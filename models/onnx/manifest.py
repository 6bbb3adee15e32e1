"""manifest.json of a folder of ONNX graphs: what each takes and gives, and the digest of each file.

    manifest.json  config.json  provenance.json  <graph>.onnx  [<graph>.onnx.data]  parity.md

Nothing here imports torch or ONNX Runtime. No graph is opened before its digest is compared.
"""

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

from diff4splat.errors import Diff4SplatError, FileFormatError
from diff4splat.io.atomic import write_text
from diff4splat.io.file_digest import file_sha256
from diff4splat.io.require_file import is_file, read_text
from diff4splat.models.onnx.shapes import Axis, parse_axis
from diff4splat.paths.formats.json_text import decode_json

MANIFEST_FILE = "manifest.json"
FORMAT, VERSION = "diff4splat-onnx", 1
DTYPES = ("float32", "int64", "bool")
PRECISIONS = ("float32", "float16", "int8", "int8-dynamic")
ADVICE = "export the model again"
Record = TypeVar("Record")


@dataclass(frozen=True, slots=True, kw_only=True)
class TensorSpec:
    """An input or output of a graph."""

    name: str
    dtype: str
    shape: tuple[Axis, ...]
    """Lengths, and expressions of named sizes (``shapes``)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileEntry:
    """A file beside the manifest."""

    name: str
    sha256: str
    bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphEntry:
    """One graph: its files, the first of which ONNX Runtime opens, its inputs and outputs."""

    name: str
    part: str
    files: tuple[FileEntry, ...]
    inputs: tuple[TensorSpec, ...]
    outputs: tuple[TensorSpec, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """Everything about an exported model."""

    model: str
    precision: str
    opset: int
    license: str
    exported_with: Mapping[str, str]
    """Versions of packages."""
    parameter_counts: Mapping[str, int]
    """Per part."""
    files: tuple[FileEntry, ...]
    """Configuration and provenance."""
    graphs: tuple[GraphEntry, ...]
    weights_stored: bool = True
    """False for graphs of shapes alone, which cannot run."""

    def graph(self, name: str) -> GraphEntry:
        """The graph of that name.

        Raises:
            FileFormatError: there is none.
        """
        for entry in self.graphs:
            if entry.name == name:
                return entry
        raise FileFormatError(f"{MANIFEST_FILE}: expected a graph {name!r}, got none; {ADVICE}")

    def of_part(self, part: str) -> tuple[GraphEntry, ...]:
        """The graphs of one network."""
        return tuple(entry for entry in self.graphs if entry.part == part)

    def weights_sha256(self, parts: Collection[str] | None = None) -> str:
        """SHA-256 over the files of the graphs of ``parts``, names included."""
        chosen = [entry for entry in self.graphs if parts is None or entry.part in parts]
        lines = sorted(f"{file.name}:{file.sha256}\n" for graph in chosen for file in graph.files)
        return hashlib.sha256("".join(lines).encode()).hexdigest()


def has_graphs(folder: Path) -> bool:
    """Whether the folder is one of ONNX graphs."""
    return is_file(folder / MANIFEST_FILE)


def write_manifest(manifest: Manifest, folder: Path) -> None:
    """Write manifest.json."""
    record = {"format": FORMAT, "version": VERSION, **asdict(manifest)}
    write_text(folder / MANIFEST_FILE, json.dumps(record, indent=1) + "\n")


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder, checked whole.

    Raises:
        FileFormatError: absent, damaged, or of a newer version.
    """
    file = folder / MANIFEST_FILE
    if not is_file(file):
        raise FileFormatError(
            f"{folder}: expected ONNX graphs with {MANIFEST_FILE}, got none; write them with "
            "diff4splat export onnx"
        )
    try:
        return _parse(decode_json(read_text(file, "a manifest of ONNX graphs")))
    except (Diff4SplatError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise FileFormatError(
            f"{file}: expected a manifest of ONNX graphs, got something else ({error}); {ADVICE}"
        ) from error


def require_files(folder: Path, entries: Collection[FileEntry]) -> None:
    """Compare files with their digests.

    Raises:
        FileFormatError: a file is absent, or not the one that was exported.
    """
    for entry in entries:
        path = folder / entry.name
        if not is_file(path):
            raise FileFormatError(f"{path}: expected a file of {MANIFEST_FILE}, got none; {ADVICE}")
        got = file_entry(path) if path.stat().st_size == entry.bytes else None
        if got != entry:
            digest = "another size" if got is None else got.sha256[:16]
            raise FileFormatError(
                f"{path}: expected SHA-256 {entry.sha256[:16]}…, got {digest}; "
                f"the file is not the one that was exported, {ADVICE}"
            )


def file_entry(path: Path) -> FileEntry:
    """Name, digest and size of a file."""
    return FileEntry(name=path.name, sha256=file_sha256(path), bytes=path.stat().st_size)


def _parse(record: Mapping[str, Any]) -> Manifest:
    if record["format"] != FORMAT or record["version"] != VERSION:
        raise ValueError(f"format {record['format']!r}, version {record['version']!r}")
    values = {key: record[key] for key in (entry.name for entry in fields(Manifest))}
    if values["precision"] not in PRECISIONS:
        raise ValueError(f"precision {values['precision']!r}")
    values["files"] = _files(values["files"])
    values["graphs"] = tuple(map(_graph, values["graphs"]))
    return Manifest(**values)


def _graph(record: Mapping[str, Any]) -> GraphEntry:
    entry = GraphEntry(
        name=str(record["name"]),
        part=str(record["part"]),
        files=_files(record["files"]),
        inputs=tuple(map(_tensor, record["inputs"])),
        outputs=tuple(map(_tensor, record["outputs"])),
    )
    if not entry.files:
        raise ValueError(f"graph {entry.name!r} without a file")
    return entry


def _tensor(record: Mapping[str, Any]) -> TensorSpec:
    shape = tuple(record["shape"])
    for axis in shape:
        parse_axis(axis)
    if record["dtype"] not in DTYPES:
        raise ValueError(f"dtype {record['dtype']!r}")
    return TensorSpec(name=str(record["name"]), dtype=record["dtype"], shape=shape)


def _files(records: Collection[Mapping[str, Any]]) -> tuple[FileEntry, ...]:
    entries = tuple(
        FileEntry(name=str(row["name"]), sha256=str(row["sha256"]), bytes=int(row["bytes"]))
        for row in records
    )
    for entry in entries:
        # A name is of this folder: a manifest from outside must not reach other files.
        if Path(entry.name).name != entry.name or entry.name in ("", ".", ".."):
            raise ValueError(f"file name {entry.name!r}")
    return entries
