"""One graph: tracing by ``torch.export``, and a file without traces of this machine."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import torch

from diff4splat.errors import ConfigError
from diff4splat.models.onnx.shapes import LinearSize, parse_axis
from diff4splat.models.onnx_export.source import GraphSource

OPSET = 20
"""GridSample and GELU are operators of their own from it on; newer ones need newer runtimes."""
EXPORTER_PACKAGES = ("onnx", "onnxscript")
INLINE_BYTES = 1 << 30
"""Weights above it lie in a file beside the graph: one file cannot hold 2 GiB."""


def require_exporter() -> None:
    """Refuse where the packages of the extra are absent.

    Raises:
        ConfigError: onnx or onnxscript is not installed.
    """
    absent = [name for name in EXPORTER_PACKAGES if find_spec(name) is None]
    if absent:
        raise ConfigError(
            f"ONNX export: expected the packages {' and '.join(EXPORTER_PACKAGES)}, got no "
            f"{' and no '.join(absent)}; pip install 'diff4splat[onnx]'"
        )


def export_graph(source: GraphSource, file: Path, *, weights: bool = True) -> None:
    """Write the graph with inputs of any size that the network takes.

    Without ``weights`` the file holds shapes alone.
    """
    device = next(source.module.parameters(), torch.empty(0)).device
    inputs = tuple(tensor.to(device) for tensor in source.examples(source.traced_sizes()))
    with torch.no_grad(), _quiet():
        program = torch.onnx.export(
            source.module.eval(),
            inputs,
            dynamo=True,
            opset_version=OPSET,
            dynamic_shapes=(tuple(_dynamic_axes(source)),),
            input_names=[entry.spec.name for entry in source.inputs],
            verbose=False,
            # Constants cannot be folded where there are no values.
            optimize=weights,
        )
    _forget_origin(program.model)
    _name_outputs(program.model.graph, [spec.name for spec in source.outputs])
    size = sum(value.numel() * 4 for value in source.module.parameters())
    program.save(
        str(file), include_initializers=weights, external_data=weights and size > INLINE_BYTES
    )


def _dynamic_axes(source: GraphSource) -> Iterator[dict[int, str]]:
    """Per input the axes that may change; equal expressions are one size."""
    for entry in source.inputs:
        yield {
            axis: _axis_name(size)
            for axis, size in enumerate(map(parse_axis, entry.spec.shape))
            if isinstance(size, LinearSize)
        }


def _axis_name(size: LinearSize) -> str:
    name = size.name if size.factor == 1 else f"{size.name}_times_{size.factor}"
    return f"{name}_plus_{size.offset}" if size.offset else name


def _forget_origin(model: "object") -> None:
    """Traces hold paths of this machine, and twice the size of a small graph."""
    for graph in (model.graph, *(function.graph for function in model.functions.values())):
        graph.metadata_props.clear()
        for node in graph.all_nodes():
            node.metadata_props.clear()
            node.doc_string = None
        for value in (*graph.inputs, *graph.outputs, *graph.initializers.values()):
            value.metadata_props.clear()
            value.doc_string = None


def _name_outputs(graph: "object", names: list[str]) -> None:
    """The exporter may have given such a name to a value inside."""
    for node in graph.all_nodes():
        for value in node.outputs:
            if value.name in names:
                value.name = f"{value.name}_inside"
    for value, name in zip(graph.outputs, names, strict=True):
        value.name = name


@contextmanager
def _quiet() -> Iterator[None]:
    """The exporter warns of packages that nothing here needs."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)
