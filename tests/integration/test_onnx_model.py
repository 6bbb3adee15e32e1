"""Every network as ONNX graphs: equal outputs at any size, equal scenes, and what is refused.

The ``test`` size has noise on all weights: layers that start at zero would hide errors. Tracing
takes most of the time: the text encoder is always exported, the rest in slow tests.
"""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
import torch
from PIL import Image

from diff4splat.cli.main import run
from diff4splat.errors import ConfigError, FileFormatError, ShapeError
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.io.scene_files.scene_file import load_scene
from diff4splat.metrics.image import psnr
from diff4splat.models.config.priors import MonocularDepthConfig
from diff4splat.models.config.sizes import test_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model, load_model, save_model, with_parts
from diff4splat.models.onnx.graph import OnnxModel
from diff4splat.models.onnx.manifest import MANIFEST_FILE, read_manifest
from diff4splat.models.onnx_export.folder import ExportSettings, export_model
from diff4splat.models.onnx_export.parity import relative_error
from diff4splat.models.onnx_export.precision import convert_precision
from diff4splat.models.onnx_export.source import GraphSource
from diff4splat.models.onnx_export.sources import graph_sources
from diff4splat.render.api import render

TOLERANCE = 1e-4
"""Relative, in float32."""
EVERYTHING = pytest.param(None, marks=pytest.mark.slow)
"""All networks."""


@pytest.fixture(scope="module", autouse=True)
def _as_shipped(module_as_shipped: None) -> None:
    """The exporter cannot trace checks of annotations."""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Model:
    """The ``test`` size, with noise on all weights.

    Of equal blocks one is enough: tracing takes most of the time.
    """
    config = test_size()
    config = replace(config, dit=replace(config.dit, blocks=1), ldrm=replace(config.ldrm, blocks=1))
    depth = MonocularDepthConfig(channels=4, image_backbone=True, uncertainty=True)
    config = replace(config, monocular_depth=depth)
    noisy = Model(config=config, networks=create_networks(config))
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for _, part in noisy.networks.parts():
            for weight in part.parameters():
                weight.add_(torch.randn(weight.shape, generator=generator), alpha=0.05)
    folder = tmp_path_factory.mktemp("model")
    save_model(noisy, folder)
    return load_model(folder)


@pytest.fixture(scope="module", params=[("text_encoder",), EVERYTHING])
def exported(
    request: pytest.FixtureRequest, model: Model, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    folder = tmp_path_factory.mktemp("onnx") / "test"
    rows = export_model(model, folder, ExportSettings(triton=True, parts=request.param))
    assert all(max(row.errors.values()) < TOLERANCE for row in rows)
    return folder


@pytest.fixture(scope="module")
def sources(model: Model, exported: Path) -> list[GraphSource]:
    names = [entry.name for entry in read_manifest(exported).graphs]
    networks = with_parts(model, model.parts).networks
    return [source for source in graph_sources(networks, model.config) if source.name in names]


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    pixels = np.random.default_rng(0).integers(0, 255, (8, 8, 3), np.uint8)
    file = tmp_path / "photo.png"
    Image.fromarray(pixels).resize((64, 64), Image.Resampling.BICUBIC).save(file)
    return file


@pytest.mark.parametrize("change", [{}, {"batch": 3}, {"packs": 0, "frames": 1}, {"tokens": 1}])
def test_every_graph_equals_its_network_at_any_size(
    exported: Path, sources: list[GraphSource], change: dict[str, int]
) -> None:
    graphs = OnnxModel(exported)
    for source in sources:
        sizes = {name: 1 for name in source.size_names}
        sizes |= {name: size for name, size in change.items() if name in sizes}
        tensors = source.examples(sizes, seed=2)
        arrays = {
            entry.spec.name: value.numpy()
            for entry, value in zip(source.inputs, tensors, strict=True)
        }
        with torch.no_grad():
            want = source.module(*tensors)
        got = graphs[source.name](arrays)
        for spec, wanted in zip(source.outputs, want, strict=True):
            error = relative_error(wanted, torch.from_numpy(got[spec.name]))
            assert error < TOLERANCE, (source.name, spec.name, sizes)


@pytest.mark.parametrize("exported", [EVERYTHING], indirect=True)
@pytest.mark.parametrize("prompt", [None, "a cube slides to the left"])
def test_both_runtimes_give_one_scene(
    model: Model, exported: Path, photo: Path, prompt: str | None
) -> None:
    settings = GenerationSettings(steps=2)
    first, second = (
        Diff4SplatPipeline.from_pretrained(folder)(photo, "arc:0.2", prompt, settings=settings)
        for folder in (model.folder, exported)
    )
    assert len(first.gaussians) == len(second.gaussians)
    for time_s in (float(first.path.times_s[0]), float(first.path.times_s[-1])):
        camera = first.path.cameras[-1]
        images = [
            render(scene.motion.state_at(scene.gaussians, time_s), camera).rgb
            for scene in (first, second)
        ]
        assert float(psnr(images[0], images[1])) >= 60
    assert first.provenance.weights_sha256 != second.provenance.weights_sha256


@pytest.mark.parametrize("exported", [EVERYTHING], indirect=True)
def test_the_command_runs_what_it_wrote(exported: Path, photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "scene"
    command = [
        "generate",
        str(photo),
        "--model",
        str(exported),
        "--runtime",
        "onnx",
        "--steps",
        "1",
    ]
    assert run([*command, "--out", str(out), "--skip-depth"]) == 0
    assert len(load_scene(out / "scene.safetensors").gaussians)


def test_graphs_run_without_torch_and_without_the_network_code(exported: Path) -> None:
    code = f"""
import sys, numpy as np
from diff4splat.models.onnx.graph import OnnxModel
states = OnnxModel({str(exported)!r})["text_encoder"](
    {{"tokens": np.array([[257, 97, 258]]), "mask": np.ones((1, 3), bool)}})["states"]
assert states.shape == (1, 3, 16), states.shape
assert "torch" not in sys.modules and "onnx" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("exported", [EVERYTHING], indirect=True)
def test_generation_imports_no_network_code(exported: Path, photo: Path, tmp_path: Path) -> None:
    code = f"""
import sys
from diff4splat.cli.main import run
assert run(["generate", {str(photo)!r}, "--model", {str(exported)!r}, "--steps", "1",
            "--out", {str(tmp_path / "scene")!r}, "--skip-depth", "--prompt", "it moves"]) == 0
networks = ("dit", "unet", "vae", "encoder", "network", "refined_network", "factory")
assert not [name for name in sys.modules if name.startswith("diff4splat.models")
            and name.rpartition(".")[2] in networks], sys.modules.keys()
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        ("graph", "text_encoder.onnx: expected SHA-256"),
        ("config", "config.json: expected SHA-256"),
        ("another graph", "text_encoder.onnx: expected SHA-256"),
        ("manifest", "expected a manifest of ONNX graphs"),
    ],
)
def test_a_changed_folder_is_refused_before_anything_runs(
    exported: Path,
    photo: Path,
    tmp_path: Path,
    damage: str,
    says: str,
    capsys: pytest.CaptureFixture,
) -> None:
    import onnx

    folder = copytree(exported, tmp_path / "copy", symlinks=True)
    file = folder / "text_encoder.onnx"
    if damage == "graph":
        file.write_bytes(file.read_bytes()[:-1] + b"\0")
    elif damage == "config":
        (folder / "config.json").write_text((folder / "config.json").read_text() + " ")
    elif damage == "another graph":
        other = onnx.load(file)
        other.producer_name = "another"
        onnx.save(other, file)
    else:
        (folder / MANIFEST_FILE).write_text("{}")
    out = tmp_path / "scene"
    command = ["generate", str(photo), "--model", str(folder), "--prompt", "a cube slides"]
    assert run([*command, "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert says in error and "export the model again" in error
    assert not out.exists()


@pytest.mark.parametrize("exported", [EVERYTHING], indirect=True)
def test_shapes_that_the_network_refuses_are_refused(exported: Path) -> None:
    encoder = OnnxModel(exported)["vae_encoder"]
    for shape in ((1, 3, 4, 32, 32), (1, 3, 5, 30, 32), (1, 1, 5, 32, 32)):
        with pytest.raises(ShapeError, match="vae_encoder, video: expected the shape"):
            encoder({"video": np.zeros(shape, np.float32)})
    with pytest.raises(ShapeError, match="expected float32, got float64"):
        encoder({"video": np.zeros((1, 3, 5, 32, 32))})
    with pytest.raises(ShapeError, match="expected the inputs video, got image"):
        encoder({"image": np.zeros((1, 3, 5, 32, 32), np.float32)})


@pytest.mark.parametrize(
    ("precision", "tolerance"), [("float16", 5e-3), ("int8", 0.1), ("int8-dynamic", 0.3)]
)
def test_fewer_bits(
    exported: Path, sources: list[GraphSource], tmp_path: Path, precision: str, tolerance: float
) -> None:
    import onnxruntime

    for source in sources:
        file = tmp_path / f"{source.name}.onnx"
        file.write_bytes((exported / file.name).read_bytes())
        convert_precision(file, precision)
        tensors = source.examples(source.traced_sizes(), seed=3)
        arrays = {
            entry.spec.name: value.numpy()
            for entry, value in zip(source.inputs, tensors, strict=True)
        }
        names = [spec.name for spec in source.outputs]
        got = onnxruntime.InferenceSession(file).run(names, arrays)
        with torch.no_grad():
            want = source.module(*tensors)
        for name, wanted, found in zip(names, want, got, strict=True):
            error = relative_error(wanted, torch.from_numpy(found))
            assert error < tolerance, (source.name, name)


def test_a_saved_copy_needs_weights(exported: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="copy its folder"):
        save_model(load_model(exported, parts=()), tmp_path / "copy")


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--runtime", "onnx", "--model", "test"], "write one with diff4splat export onnx"),
        (["--runtime", "torch", "--model", "EXPORTED"], "expected --model with PyTorch weights"),
        (["--device", "cuda", "--model", "EXPORTED"], "expected cpu for ONNX graphs"),
    ],
)
def test_the_wrong_runtime_is_refused(
    exported: Path,
    photo: Path,
    tmp_path: Path,
    options: list[str],
    expected: str,
    capsys: pytest.CaptureFixture,
) -> None:
    options = [str(exported) if option == "EXPORTED" else option for option in options]
    assert run(["generate", str(photo), "--out", str(tmp_path / "out"), *options]) == 2
    assert expected in capsys.readouterr().err


def test_triton_finds_every_graph(exported: Path) -> None:
    for entry in read_manifest(exported).graphs:
        own = exported / "triton" / entry.name
        assert (own / "1" / "model.onnx").resolve() == (exported / entry.files[0].name).resolve()
        text = (own / "config.pbtxt").read_text()
        assert f'name: "{entry.name}"' in text and "max_batch_size: 0" in text


@pytest.mark.slow
def test_shapes_of_the_published_size_without_weights(tmp_path: Path) -> None:
    folder = tmp_path / "paper"
    export_model(load_model("paper", parts=()), folder, ExportSettings(shapes_only=True))
    manifest = json.loads((folder / MANIFEST_FILE).read_text())
    assert not manifest["weights_stored"] and len(manifest["graphs"]) == 7
    with pytest.raises(FileFormatError, match="expected graphs with weights, got shapes alone"):
        OnnxModel(folder)["text_encoder"]
