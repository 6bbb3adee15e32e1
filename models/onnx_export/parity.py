"""ONNX Runtime against PyTorch: error of every output, bytes and time.

Relative error: the largest difference over the largest value of PyTorch's output. Inputs are random
numbers of the ranges that the networks are made for, at sizes that the graph was not traced with.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from diff4splat.models.onnx.graph import OnnxGraph
from diff4splat.models.onnx_export.source import GraphSource

RUNS = 3
"""Of which the fastest counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parity:
    """One graph."""

    graph: str
    errors: dict[str, float]
    """Relative, per output."""
    bytes: int
    torch_s: float
    onnx_s: float


def other_sizes(source: GraphSource) -> dict[str, int]:
    """Sizes unlike those of tracing: one sample, and everything else larger by one."""
    return {
        name: 1 if name == "batch" else size + 1 for name, size in source.traced_sizes().items()
    }


@torch.no_grad()
def measure_parity(source: GraphSource, graph: OnnxGraph) -> Parity:
    """Both runtimes on the same inputs and as many threads."""
    tensors = source.examples(other_sizes(source), seed=1)
    names = [entry.spec.name for entry in source.inputs]
    arrays = {name: tensor.numpy() for name, tensor in zip(names, tensors, strict=True)}
    want, torch_s = _fastest(lambda: source.module.eval()(*tensors))
    got, onnx_s = _fastest(lambda: graph(arrays))
    errors = {
        spec.name: relative_error(wanted, torch.from_numpy(got[spec.name]))
        for spec, wanted in zip(source.outputs, want, strict=True)
    }
    size = sum(entry.bytes for entry in graph.entry.files)
    return Parity(graph=source.name, errors=errors, bytes=size, torch_s=torch_s, onnx_s=onnx_s)


def relative_error(want: Tensor, got: Tensor) -> float:
    """Largest difference over largest value; infinite where shapes or finiteness differ."""
    if want.shape != got.shape or not bool((want.isfinite() == got.isfinite()).all()):
        return float("inf")
    scale = want.abs().max().clamp_min(torch.finfo(want.dtype).tiny)
    difference = (want - got).abs().max()
    return float(difference / scale) if difference > 0 else 0.0


def parity_table(rows: Sequence[Parity], precision: str) -> str:
    """The rows as Markdown."""
    lines = [
        f"# ONNX Runtime against PyTorch, {precision}",
        "",
        "Largest difference over largest value, at sizes that the graphs were not traced with; the",
        "fastest of three runs.",
        "",
        "| graph | output | relative error | MB | PyTorch ms | ONNX Runtime ms |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for row in rows:
        worst = max(row.errors, key=row.errors.__getitem__)
        lines.append(
            f"| {row.graph} | {worst} | {row.errors[worst]:.1e} | {row.bytes / 1e6:.2f} "
            f"| {1e3 * row.torch_s:.1f} | {1e3 * row.onnx_s:.1f} |"
        )
    total = sum(row.bytes for row in rows) / 1e6
    lines += ["", f"All graphs: {total:.1f} MB. The output with the largest error is named."]
    return "\n".join(lines) + "\n"


def _fastest(call: Callable[[], object]) -> tuple[object, float]:
    call()
    seconds = []
    for _ in range(RUNS):
        start = time.perf_counter()
        result = call()
        seconds.append(time.perf_counter() - start)
    return result, min(seconds)
