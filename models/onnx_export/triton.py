"""A model repository of Triton Inference Server beside the graphs.

    triton/<graph>/config.pbtxt  triton/<graph>/1/model.onnx → ../../../<graph>.onnx

The batch axis is explicit and requests differ in shape, so ``max_batch_size`` is 0.
"""

from pathlib import Path

from diff4splat.io.atomic import write_text
from diff4splat.models.onnx.manifest import GraphEntry, Manifest, TensorSpec

TRITON_FOLDER = "triton"
DATA_TYPES = {"float32": "TYPE_FP32", "int64": "TYPE_INT64", "bool": "TYPE_BOOL"}


def write_triton_repository(manifest: Manifest, folder: Path) -> None:
    """Configurations, and links to the graphs: nothing is stored twice."""
    for graph in manifest.graphs:
        own = folder / TRITON_FOLDER / graph.name
        (own / "1").mkdir(parents=True, exist_ok=True)
        write_text(own / "config.pbtxt", graph_config(graph))
        for index, file in enumerate(graph.files):
            # External weights are found under the name that the graph states.
            name = "model.onnx" if index == 0 else file.name
            link = own / "1" / name
            link.unlink(missing_ok=True)
            link.symlink_to(Path("../../..") / file.name)


def graph_config(graph: GraphEntry) -> str:
    """The text of a config.pbtxt."""
    lines = [
        f'name: "{graph.name}"',
        'backend: "onnxruntime"',
        "max_batch_size: 0",
        *(_tensor("input", spec) for spec in graph.inputs),
        *(_tensor("output", spec) for spec in graph.outputs),
        "instance_group [ { count: 1 kind: KIND_CPU } ]",
    ]
    return "\n".join(lines) + "\n"


def _tensor(kind: str, spec: TensorSpec) -> str:
    dims = ", ".join(str(axis) if isinstance(axis, int) else "-1" for axis in spec.shape)
    return (
        f'{kind} [ {{ name: "{spec.name}" data_type: {DATA_TYPES[spec.dtype]} dims: [{dims}] }} ]'
    )
