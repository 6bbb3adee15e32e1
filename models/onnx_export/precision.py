"""Graphs in fewer bits.

    float16        computed in half precision, float32 at inputs and outputs
    int8           weights as int8 with one scale per output channel; computed in float32
    int8-dynamic   matrix products in int8, with scales of the inputs found at run time

Weights with few elements, and those of the first and last layers, stay in float32.
"""

from pathlib import Path

import numpy as np

from diff4splat.errors import ConfigError

LEAST_ELEMENTS = 1024
"""Smaller weights stay: they hardly count in bytes, but in error."""
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
    import onnx
    from onnxruntime.transformers.float16 import convert_float_to_float16

    model = onnx.load(file)
    # Shapes from the exporter are expressions that the converter cannot read.
    del model.graph.value_info[:]
    _save(convert_float_to_float16(model, keep_io_types=True, disable_shape_infer=True), file)


def _to_int8_dynamic(file: Path) -> None:
    import onnx
    from onnxruntime.quantization import QuantType, quantize_dynamic

    model = onnx.load(file)
    del model.graph.value_info[:]
    quantize_dynamic(
        model,
        str(file),
        op_types_to_quantize=["MatMul", "Gemm"],
        per_channel=True,
        weight_type=QuantType.QInt8,
        extra_options={"DefaultTensorType": 1},
    )


def _to_int8_weights(file: Path) -> None:
    import onnx
    from onnx import numpy_helper

    model = onnx.load(file)
    graph = model.graph
    stored = {entry.name: entry for entry in graph.initializer}
    axes = _weight_axes(graph)
    for name in [name for name in axes if name in stored]:
        values = numpy_helper.to_array(stored[name])
        if values.dtype != np.float32 or values.size < LEAST_ELEMENTS:
            continue
        whole, scale = quantized(values, axes[name])
        graph.initializer.remove(stored[name])
        graph.initializer.append(numpy_helper.from_array(whole, f"{name}_int8"))
        graph.initializer.append(numpy_helper.from_array(scale, f"{name}_scale"))
        inputs = [f"{name}_int8", f"{name}_scale"]
        node = onnx.helper.make_node("DequantizeLinear", inputs, [name], axis=axes[name])
        graph.node.insert(0, node)
    _save(model, file)


def quantized(values: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Symmetric int8 with one scale for each index of ``axis``; zeros have the scale 1."""
    others = tuple(other for other in range(values.ndim) if other != axis)
    scale = np.abs(values).max(axis=others) / 127
    scale = np.where(scale > 0, scale, 1).astype(np.float32)
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
    import onnx

    data = file.with_name(f"{file.name}.data")
    external = data.exists()
    data.unlink(missing_ok=True)
    onnx.save(model, file, save_as_external_data=external, location=data.name)
