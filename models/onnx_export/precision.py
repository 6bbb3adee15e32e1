"""Graphs in fewer bits.

    float16        weights in half precision; computed in float32
    int8           weights as int8 with one scale per output channel; computed in float32
    int8-dynamic   matrix products in int8, with scales of the inputs found at run time

Weights with few elements stay in float32. Nothing is computed in float16: ONNX Runtime has no such
kernels for CPUs, and the angles of noise levels and positions do not survive it.
"""

import logging
import math
from pathlib import Path

import numpy as np

from diff4splat.errors import ConfigError
from diff4splat.io.onnx_package import onnx_package

LEAST_ELEMENTS = 40_000
"""Smaller weights stay: with them scenes of ``small`` are at 34 dB instead of 39, and they hardly
count in bytes."""
WEIGHTED = {"Conv": 0, "ConvTranspose": 1, "Gemm": 1, "MatMul": 1}
"""Operators with weights, and the axis of the output channels of these."""


def convert_precision(file: Path, precision: str) -> None:
    """Rewrite the graph in ``file`` in place.

    Raises:
        ConfigError: an unknown precision.
    """
    converters = {
        "float32": lambda file: None,
        "float16": _to_float16,
        "int8": _to_int8_weights,
        "int8-dynamic": _to_int8_dynamic,
    }
    if precision not in converters:
        raise ConfigError(f"precision: expected one of {', '.join(converters)}, got {precision!r}")
    converters[precision](file)


def _to_float16(file: Path) -> None:
    onnx = onnx_package()

    model = onnx.load(file)
    graph = model.graph
    for stored in [entry for entry in graph.initializer if _is_large(entry)]:
        half = onnx.numpy_helper.to_array(stored).astype(np.float16)
        graph.initializer.remove(stored)
        graph.initializer.append(onnx.numpy_helper.from_array(half, f"{stored.name}_float16"))
        inputs, outputs = [f"{stored.name}_float16"], [stored.name]
        graph.node.insert(
            0, onnx.helper.make_node("Cast", inputs, outputs, to=onnx.TensorProto.FLOAT)
        )
    _save(model, file)


def _to_int8_dynamic(file: Path) -> None:
    onnx = onnx_package()
    from onnxruntime.quantization import QuantType, quantize_dynamic

    model = onnx.load(file)
    # Shapes from the exporter are expressions that the converter cannot read.
    del model.graph.value_info[:]
    logging.getLogger().addFilter(_no_advice)
    quantize_dynamic(
        model,
        str(file),
        op_types_to_quantize=["MatMul", "Gemm"],
        per_channel=True,
        nodes_to_exclude=_small_products(model.graph),
        weight_type=QuantType.QInt8,
        extra_options={"DefaultTensorType": 1},
    )


def _no_advice(record: logging.LogRecord) -> bool:
    """The converter recommends a step that fails on graphs of this exporter."""
    return "pre-processing before quantization" not in record.getMessage()


def _to_int8_weights(file: Path) -> None:
    onnx = onnx_package()

    model = onnx.load(file)
    graph, axes = model.graph, _weight_axes(model.graph)
    for stored in [entry for entry in graph.initializer if _is_large(entry)]:
        if stored.name not in axes:
            continue
        name, axis = stored.name, axes[stored.name]
        whole, scale = quantized(onnx.numpy_helper.to_array(stored), axis)
        graph.initializer.remove(stored)
        graph.initializer.append(onnx.numpy_helper.from_array(whole, f"{name}_int8"))
        graph.initializer.append(onnx.numpy_helper.from_array(scale, f"{name}_scale"))
        inputs = [f"{name}_int8", f"{name}_scale"]
        graph.node.insert(0, onnx.helper.make_node("DequantizeLinear", inputs, [name], axis=axis))
    _save(model, file)


def _small_products(graph: object) -> list[str]:
    """Names of the matrix products that stay in float32."""
    large = {entry.name for entry in graph.initializer if _is_large(entry)}
    return [node.name for node in graph.node if not large.intersection(node.input)]


def _is_large(entry: object) -> bool:
    """Whether it is float32 and worth fewer bits."""
    onnx = onnx_package()

    return entry.data_type == onnx.TensorProto.FLOAT and math.prod(entry.dims) >= LEAST_ELEMENTS


def quantized(values: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Symmetric int8 with one scale for each index of ``axis``; zeros have the scale 1."""
    others = tuple(other for other in range(values.ndim) if other != axis)
    largest = np.abs(values).max(axis=others)
    # A subnormal scale would have too few digits.
    scale = np.maximum(largest / 127, np.finfo(np.float32).tiny)
    scale = np.where(largest > 0, scale, 1).astype(np.float32)
    shape = [-1 if other == axis else 1 for other in range(values.ndim)]
    return np.clip(np.rint(values / scale.reshape(shape)), -127, 127).astype(np.int8), scale


def _weight_axes(graph: object) -> dict[str, int]:
    """Weights that every reader takes along the same axis."""
    axes: dict[str, int] = {}
    shared = set()
    for node in graph.node:
        for position, name in enumerate(node.input):
            axis = WEIGHTED.get(node.op_type) if position == 1 else None
            if axis is not None and node.op_type == "Gemm":
                axis = 0 if any(a.name == "transB" and a.i for a in node.attribute) else 1
            if axis is None or axes.setdefault(name, axis) != axis:
                shared.add(name)
    return {name: axis for name, axis in axes.items() if name not in shared}


def _save(model: object, file: Path) -> None:
    onnx = onnx_package()

    data = file.with_name(f"{file.name}.data")
    external = data.exists()
    data.unlink(missing_ok=True)
    onnx.save(model, file, save_as_external_data=external, location=data.name)
