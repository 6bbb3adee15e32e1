"""LPIPS weights from the files in circulation, safetensors or torch; nothing in them is executed.

Two layouts, distinguished by their names:

    the lpips package's state    net.slice2.5.weight …  lin0.model.1.weight …  scaling_layer.shift
    torchvision's network        features.5.weight …  (classifier.… is not needed)
    beside lpips' heads file     lin0.model.1.weight …

Newer versions of the package hold every head twice, as ``lin0`` and as ``lins.0``.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor

from diff4splat.errors import CheckpointError
from diff4splat.metrics.features.backbones import Backbone
from diff4splat.metrics.features.lpips import SCALE, SHIFT
from diff4splat.metrics.features.tensor_files import read_tensors, refuse, require_weights

SCALING = {"scaling_layer.shift": SHIFT, "scaling_layer.scale": SCALE}


def read_lpips_weights(files: Sequence[Path], trunk: Backbone) -> dict[str, Tensor]:
    """All weights of one or two files, float32, by the names of the lpips package.

    Raises:
        CheckpointError: a file is absent, or names or shapes are not those of the trunk.
        FileFormatError: a file is damaged or holds something other than tensors.
    """
    found: dict[str, Tensor] = {}
    for file in files:
        named = _by_package_names(read_tensors(file), trunk)
        refuse(sorted(named.keys() & found.keys()), f"{file}: given by the other file too")
        found |= named
    wanted, what = expected_shapes(trunk), f"LPIPS-{trunk.name} weights"
    refuse([key for key in found if key not in wanted], f"{what}: unexpected")
    return require_weights(found, wanted, what)


def expected_shapes(trunk: Backbone) -> dict[str, tuple[int, ...]]:
    """Name and shape of every weight that LPIPS with this trunk has."""
    shapes: dict[str, tuple[int, ...]] = {}
    for name, layer in trunk.convolutions().items():
        shapes[f"{name}.weight"] = (layer.outputs, layer.inputs, layer.kernel, layer.kernel)
        shapes[f"{name}.bias"] = (layer.outputs,)
    for number, channels in enumerate(trunk.channels):
        shapes[f"lin{number}.model.1.weight"] = (1, channels, 1, 1)
    return shapes


def _by_package_names(tensors: dict[str, Tensor], trunk: Backbone) -> dict[str, Tensor]:
    slices = {layer.index: name for name, layer in trunk.convolutions().items()}
    named: dict[str, Tensor] = {}
    for key, value in tensors.items():
        if key in SCALING:
            _require_scaling(key, value)
        elif match := re.fullmatch(r"features\.(\d+)\.(weight|bias)", key):
            # A layer that this trunk lacks keeps its name and is refused under it.
            prefix = slices.get(int(match[1]), f"features.{match[1]}")
            named[f"{prefix}.{match[2]}"] = value
        elif match := re.fullmatch(r"lins\.(\d+)\.(.+)", key):
            named.setdefault(f"lin{match[1]}.{match[2]}", value)
        elif not key.startswith("classifier."):
            named[key] = value
    return named


def _require_scaling(key: str, value: Tensor) -> None:
    """The package stores its input scaling; another one would be another metric."""
    expected, got = torch.tensor(SCALING[key]), value.float().flatten()
    # Loose enough for weights stored in half precision.
    if got.shape != expected.shape or not torch.allclose(got, expected, atol=2e-3):
        raise CheckpointError(
            f"LPIPS weights: expected {key} of version 0.1, {SCALING[key]}, got {got.tolist()}; "
            "use weights of version 0.1"
        )
