"""Scenes of the inputs with the networks in PyTorch, or as graphs in ONNX Runtime.

The networks of a default generation are exported once, with the first run.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path
from shutil import copytree
from tempfile import TemporaryDirectory

from diff4splat.error_time.subjects import scenes
from diff4splat.error_time.subjects.inputs import Inputs
from diff4splat.error_time.subjects.model import shipped_model
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.hub.model import Model, load_model
from diff4splat.models.onnx.manifest import file_entry, read_manifest, write_manifest
from diff4splat.models.onnx_export.export import require_exporter
from diff4splat.models.onnx_export.folder import ExportSettings, export_model
from diff4splat.models.onnx_export.precision import convert_precision

EAGER, FLOAT32 = "PyTorch", "float32"
PARTS = ("text_encoder", "monocular_depth", "motion_unet", "object_mask", "image_classifier")
"""What a generation without video fill runs."""


def run(runtime: str, inputs: Inputs) -> scenes.Scenes:
    """Scenes with the networks in ``PyTorch``, or in ``ONNX Runtime`` with a precision."""
    model = shipped_model() if runtime == EAGER else graph_model(runtime.rpartition(" ")[2])
    return scenes.generate(model, GenerationSettings(), inputs)


@cache
def graph_model(precision: str) -> Model:
    """The shipped model as graphs.

    Raises:
        ConfigError: the packages of the exporter are not installed.
    """
    exported = _graphs() / FLOAT32
    folder = exported.with_name(precision)
    if folder != exported:
        copytree(exported, folder)
        _convert(folder, precision)
    return load_model(folder, parts=PARTS)


def _graphs() -> Path:
    return Path(_exported().name)


@cache
def _exported() -> TemporaryDirectory[str]:
    """Graphs in single precision; the folder lives as long as the process."""
    require_exporter()
    folder = TemporaryDirectory(prefix="diff4splat-graphs-")
    settings = ExportSettings(parity=False, parts=PARTS)
    export_model(shipped_model(), Path(folder.name) / FLOAT32, settings)
    return folder


def _convert(folder: Path, precision: str) -> None:
    """Rewrite the graphs of ``folder``, and their digests in the manifest."""
    manifest, graphs = read_manifest(folder), []
    for entry in manifest.graphs:
        convert_precision(folder / entry.files[0].name, precision)
        files = tuple(file_entry(folder / one.name) for one in entry.files)
        graphs.append(replace(entry, files=files))
    write_manifest(replace(manifest, precision=precision, graphs=tuple(graphs)), folder)
