"""ONNX Runtime against PyTorch on ordinary and on extreme inputs, both in float32.

Exporting all networks takes minutes, so the report exports the two smallest itself.
"""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from diff4splat.models.onnx.graph import OnnxGraph
from diff4splat.models.onnx.manifest import GraphEntry, Manifest, file_entry
from diff4splat.models.onnx_export.export import EXPORTER_PACKAGES, OPSET, export_graph
from diff4splat.models.onnx_export.parity import other_sizes, relative_error
from diff4splat.models.onnx_export.source import GraphSource
from diff4splat.stability.check import Check, NotRunError, Outcome
from diff4splat.stability.checks.network_checks import sources

GROUP = "onnx"
PARTS = ("text_encoder", "monocular_depth")
LIMIT = 1e-4
INPUTS: dict[str, Callable[[Tensor], Tensor]] = {
    "ordinary": lambda values: values,
    "zero": torch.zeros_like,
    "1e4 times as large": lambda values: 1e4 * values,
    "with NaN": lambda values: values.index_fill(-1, torch.tensor([0]), torch.nan),
}
"""What becomes of the floating-point inputs."""


def onnx_checks(model: str) -> Iterator[Check]:
    """Each graph with each kind of input; those without floating-point inputs once."""
    for source in sources(model):
        if source.part not in PARTS:
            continue
        floats = any(entry.spec.dtype == "float32" for entry in source.inputs)
        for name in INPUTS if floats else ("ordinary",):
            yield Check(
                group=GROUP,
                name=f"{source.name}, {name} inputs",
                run=partial(measure_graph, source, name),
                limit=LIMIT,
                error_unit="largest difference over largest value",
            )


@torch.no_grad()
def measure_graph(source: GraphSource, inputs: str) -> Outcome:
    """Outputs must agree, and be NaN at the same places."""
    graph, change = _exported(source), INPUTS[inputs]
    tensors = [
        change(value) if value.is_floating_point() else value
        for value in source.examples(other_sizes(source), seed=1)
    ]
    got = graph(_arrays(source, tensors))
    want = source.module.eval()(*tensors)
    error, lost, finite = 0.0, 0, True
    for spec, wanted in zip(source.outputs, want, strict=True):
        output = torch.from_numpy(got[spec.name])
        # NaN in, NaN out: what counts is that both runtimes have it at the same places.
        same = torch.equal(output.isfinite(), wanted.isfinite())
        finite, lost = finite and same, lost + int((~wanted.isfinite()).sum())
        known = wanted.isfinite() & output.isfinite()
        if bool(known.any()):
            error = max(error, relative_error(wanted[known], output[known]))
    note = f"{lost:,} outputs not finite in PyTorch" if lost else ""
    return Outcome(error=error, value_finite=finite, note=note)


@cache
def _exported(source: GraphSource) -> OnnxGraph:
    """The graph, read before its folder goes."""
    absent = [name for name in EXPORTER_PACKAGES if find_spec(name) is None]
    if absent:
        raise NotRunError(f"{' and '.join(absent)} not installed; pip install 'diff4splat[onnx]'")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{source.name}.onnx"
        export_graph(source, file)
        graph = OnnxGraph(Path(folder), _manifest(source, file), source.name)
        # Runs once, because the file is opened with the first run.
        graph(_arrays(source, source.examples(source.traced_sizes())))
    return graph


def _manifest(source: GraphSource, file: Path) -> Manifest:
    entry = GraphEntry(
        name=source.name,
        part=source.part,
        files=(file_entry(file),),
        inputs=tuple(entry.spec for entry in source.inputs),
        outputs=source.outputs,
    )
    return Manifest(
        model="stability report",
        precision="float32",
        opset=OPSET,
        license="unknown",
        exported_with={},
        parameter_counts={},
        files=(),
        graphs=(entry,),
        weights_stored=True,
    )


def _arrays(source: GraphSource, tensors: Sequence[Tensor]) -> dict[str, np.ndarray]:
    names = [entry.spec.name for entry in source.inputs]
    return {name: value.numpy() for name, value in zip(names, tensors, strict=True)}
