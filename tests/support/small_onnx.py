"""Small ONNX graphs in the contracts of public depth networks, made with ONNX's own helper."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

FLOAT, INT64 = TensorProto.FLOAT, TensorProto.INT64


def tensor(name: str, shape: list[int | str], dtype: int = FLOAT) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, dtype, shape)


def weight(name: str, values: np.ndarray) -> onnx.TensorProto:
    return numpy_helper.from_array(np.asarray(values), name)


def conv(kernel: int, value: str = "image", output: str = "map", channels: int = 1) -> list:
    """A convolution with one output channel, as wide as its stride."""
    return [
        helper.make_node(
            "Conv", [value, "kernel"], [output], kernel_shape=[kernel] * 2, strides=[kernel] * 2
        )
    ], [weight("kernel", np.full((channels, 3, kernel, kernel), 1 / (3 * kernel**2), np.float32))]


def save(
    file: Path,
    nodes: list,
    weights: list,
    inputs: list,
    outputs: list,
    metadata: Mapping[str, str] | None = None,
    domains: tuple[str, ...] = (),
) -> Path:
    graph = helper.make_graph(nodes, "depth", inputs, outputs, weights)
    opsets = [helper.make_opsetid("", 17), *(helper.make_opsetid(name, 1) for name in domains)]
    model = helper.make_model(graph, opset_imports=opsets, ir_version=9)
    if metadata:
        helper.set_model_props(model, dict(metadata))
    onnx.save(model, file)
    return file


def one_map(
    file: Path,
    kernel: int = 14,
    names: tuple[str, str] = ("pixel_values", "predicted_depth"),
    sides: tuple[int | str, int | str] = ("h", "w"),
    normalised: bool = False,
    metadata: Mapping[str, str] | None = None,
) -> Path:
    """Mean of every patch of the input: what a Depth Anything, DPT or MiDaS graph looks like."""
    image, output = names
    nodes, weights = conv(kernel, "scaled" if normalised else image, "mean")
    if normalised:
        weights.append(weight("middle", np.float32(0.25)))
        nodes.insert(0, helper.make_node("Sub", [image, "middle"], ["scaled"]))
    weights.append(weight("axis", np.array([1], np.int64)))
    nodes.append(helper.make_node("Squeeze", ["mean", "axis"], [output]))
    return save(
        file,
        nodes,
        weights,
        [tensor(image, [1, 3, *sides])],
        [tensor(output, [1, "y", "x"])],
        metadata,
    )


def constant(file: Path, values: np.ndarray) -> Path:
    """The same answer for every image, such as NaN or no pixel at all."""
    nodes, weights = conv(14, "pixel_values", "unused")
    nodes += [helper.make_node("Identity", ["answer"], ["predicted_depth"])]
    weights.append(weight("answer", values.astype(np.float32)))
    inputs = [tensor("pixel_values", [1, 3, "h", "w"])]
    return save(file, nodes, weights, inputs, [tensor("predicted_depth", [1, "y", "x"])])


def moge(file: Path, points: np.ndarray, mask: np.ndarray, scale: float) -> Path:
    """A point map (h, w, 3) whatever the image."""
    nodes = [
        helper.make_node("ReduceMean", ["image"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "zero"], ["nothing"]),
        helper.make_node("Add", ["all_points", "nothing"], ["points"]),
        helper.make_node("Identity", ["all_mask"], ["mask"]),
        helper.make_node("Identity", ["unit"], ["scale"]),
        helper.make_node("Identity", ["num_tokens"], ["tokens"]),
    ]
    weights = [
        weight("zero", np.float32(0)),
        weight("all_points", points[None].astype(np.float32)),
        weight("all_mask", mask[None].astype(np.float32)),
        weight("unit", np.array([scale], np.float32)),
    ]
    outputs = [
        tensor("points", [1, *points.shape]), tensor("mask", [1, *mask.shape]),
        tensor("scale", [1]), tensor("tokens", [], INT64),
    ]  # fmt: skip
    inputs = [tensor("image", [1, 3, "h", "w"]), tensor("num_tokens", [], INT64)]
    return save(file, nodes, weights, inputs, outputs)


def with_external_weights(file: Path, location: str, count: int = 4) -> Path:
    """A Depth Anything graph whose kernel is in another file, under any name."""
    one_map(file)
    model = onnx.load(file, load_external_data=False)
    kernel = model.graph.initializer[0]
    kernel.ClearField("raw_data")
    kernel.data_location = TensorProto.EXTERNAL
    for key, value in (("location", location), ("offset", "0"), ("length", str(count))):
        entry = kernel.external_data.add()
        entry.key, entry.value = key, value
    file.write_bytes(model.SerializeToString())
    return file
