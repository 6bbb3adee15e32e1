"""A model as a folder of ONNX graphs with manifest, parity report and Triton repository."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from diff4splat.io.atomic import atomic_folder, write_text
from diff4splat.models.factory import create_networks, parameter_counts
from diff4splat.models.hub.model import Model, with_parts
from diff4splat.models.hub.provenance import PROVENANCE_FILE, ModelProvenance, write_provenance
from diff4splat.models.hub.weight_files import CONFIG_FILE
from diff4splat.models.onnx.graph import OnnxModel
from diff4splat.models.onnx.manifest import (
    MANIFEST_FILE,
    GraphEntry,
    Manifest,
    file_entry,
    write_manifest,
)
from diff4splat.models.onnx_export.export import OPSET, export_graph
from diff4splat.models.onnx_export.parity import Parity, measure_parity, parity_table
from diff4splat.models.onnx_export.precision import convert_precision
from diff4splat.models.onnx_export.source import GraphSource
from diff4splat.models.onnx_export.sources import graph_sources
from diff4splat.models.onnx_export.triton import write_triton_repository

PARITY_FILE = "parity.md"
PACKAGES = ("diff4splat", "torch", "onnx", "onnxscript", "onnxruntime")


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportSettings:
    """How a model is exported."""

    precision: str = "float32"
    shapes_only: bool = False
    """Without weights, from the meta device: for sizes that this machine cannot hold."""
    parity: bool = True
    parts: tuple[str, ...] | None = None
    """Networks to export; None is all."""
    triton: bool = False


def export_model(
    model: Model,
    folder: Path,
    settings: ExportSettings,
    advance: Callable[[], None] = lambda: None,
) -> list[Parity]:
    """Write everything into ``folder``; ``advance`` is called after each graph.

    Raises:
        ConfigError: an unknown precision, or the model does not fit into memory.
        OutputError: the folder cannot be written.
    """
    if settings.shapes_only:
        networks = create_networks(model.config, "meta")
    else:
        networks = with_parts(model, settings.parts or model.parts).networks
    sources = [
        source
        for source in graph_sources(networks, model.config)
        if settings.parts is None or source.part in settings.parts
    ]
    owned = [MANIFEST_FILE, CONFIG_FILE, PROVENANCE_FILE, PARITY_FILE]
    owned += [f"{source.name}.onnx{suffix}" for source in sources for suffix in ("", ".data")]
    with atomic_folder(folder, owned) as staging:
        entries = []
        for source in sources:
            entries.append(_write_graph(source, staging, settings))
            advance()
        manifest = _manifest(model, tuple(entries), staging, settings)
        write_manifest(manifest, staging)
        rows = _parity(sources, staging, settings)
    if settings.triton:
        write_triton_repository(manifest, folder)
    return rows


def graph_names(model: Model) -> list[str]:
    """Names of the graphs that an export writes."""
    networks = create_networks(model.config, "meta")
    return [source.name for source in graph_sources(networks, model.config)]


def _write_graph(source: GraphSource, folder: Path, settings: ExportSettings) -> GraphEntry:
    file = folder / f"{source.name}.onnx"
    export_graph(source, file, weights=not settings.shapes_only)
    if not settings.shapes_only:
        convert_precision(file, settings.precision)
    data = file.with_name(f"{file.name}.data")
    files = (file, data) if data.exists() else (file,)
    return GraphEntry(
        name=source.name,
        part=source.part,
        files=tuple(map(file_entry, files)),
        inputs=tuple(entry.spec for entry in source.inputs),
        outputs=source.outputs,
    )


def _manifest(
    model: Model, graphs: tuple[GraphEntry, ...], folder: Path, settings: ExportSettings
) -> Manifest:
    write_text(folder / CONFIG_FILE, model.config.to_json())
    provenance = ModelProvenance(trained=model.trained, license=model.license, origin=model.origin)
    write_provenance(provenance, folder)
    return Manifest(
        model=model.config.name,
        precision=settings.precision,
        opset=OPSET,
        license=model.license,
        exported_with={name: version(name) for name in PACKAGES},
        parameter_counts=dict(parameter_counts(model.config)),
        files=tuple(file_entry(folder / name) for name in (CONFIG_FILE, PROVENANCE_FILE)),
        graphs=graphs,
        weights_stored=not settings.shapes_only,
    )


def _parity(sources: list[GraphSource], folder: Path, settings: ExportSettings) -> list[Parity]:
    if settings.shapes_only or not settings.parity:
        return []
    graphs = OnnxModel(folder)
    rows = [measure_parity(source, graphs[source.name]) for source in sources]
    write_text(folder / PARITY_FILE, parity_table(rows, settings.precision))
    return rows
