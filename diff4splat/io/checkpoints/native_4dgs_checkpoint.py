"""Checkpoints of native 4D Gaussians (Yang et al., ICLR 2024, arXiv 2310.10642).

    chkpntN.pth    (values, iteration), as ``torch.save`` writes them

The values are the 19 entries of the program's ``GaussianModel.capture``. Only the Gaussians are
read; the optimiser state is ignored. No code in the file is run.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.io.checkpoints.native_4dgs_import import RawSpacetime
from diff4splat.io.checkpoints.torch_file import load_torch_file

_ENTRIES = 19
_INDEX = {
    "positions": 1,
    "constant_colors": 2,
    "other_colors": 3,
    "log_scales": 4,
    "left_quats": 5,
    "opacity_logits": 6,
    "times_s": 13,
    "log_time_scales": 14,
    "right_quats": 15,
}
_WIDTHS = {
    "positions": 3,
    "log_scales": 3,
    "left_quats": 4,
    "opacity_logits": 1,
    "times_s": 1,
    "log_time_scales": 1,
    "right_quats": 4,
}
_HAS_4D_ROTATION, _ENVIRONMENT_MAP = 16, 17


@dataclass(frozen=True, slots=True, kw_only=True)
class NativeCheckpoint:
    """The Gaussians of a checkpoint, before activation."""

    raw: RawSpacetime
    has_environment_map: bool
    """Whether the checkpoint also has a background, which scenes cannot hold."""


def read_native_4dgs_checkpoint(file: Path) -> NativeCheckpoint:
    """Read the Gaussians of a checkpoint, as float32.

    Raises:
        FileFormatError: the file is missing, damaged, would run code, or has no 4D Gaussians with
            4D rotations.
    """
    values = _load(file)
    if not bool(values[_HAS_4D_ROTATION]):
        raise FileFormatError(
            f"{file}: expected Gaussians with 4D rotations, got a run without rot_4d"
        )
    tensors = {name: _tensor(values[index], name, file) for name, index in _INDEX.items()}
    _require_shapes(tensors, file)
    has_map = isinstance(values[_ENVIRONMENT_MAP], Tensor) and values[_ENVIRONMENT_MAP].numel() > 0
    return NativeCheckpoint(raw=RawSpacetime(**tensors), has_environment_map=has_map)


def _load(file: Path) -> Sequence[object]:
    content = load_torch_file(file, "a checkpoint of native 4D Gaussians (.pth)")
    is_pair = isinstance(content, tuple | list) and len(content) == 2
    values = content[0] if is_pair else None
    if not isinstance(values, tuple | list) or len(values) != _ENTRIES:
        raise FileFormatError(
            f"{file}: expected (values, iteration) with the {_ENTRIES} values of a 4D Gaussian "
            "model, got another structure; give a chkpnt file of native 4D Gaussians"
        )
    return values


def _tensor(value: object, name: str, file: Path) -> Tensor:
    if not isinstance(value, Tensor) or not value.is_floating_point():
        raise FileFormatError(f"{file}: {name}: expected a tensor, got {type(value).__name__}")
    return value.detach().float()


def _require_shapes(tensors: dict[str, Tensor], file: Path) -> None:
    count = len(tensors["positions"]) if tensors["positions"].ndim else 0
    for name, tensor in tensors.items():
        shape = tuple(tensor.shape)
        if name in _WIDTHS:
            is_valid = shape == (count, _WIDTHS[name])
        else:
            is_valid = len(shape) == 3 and (shape[0], shape[2]) == (count, 3)
        if not is_valid:
            raise FileFormatError(f"{file}: {name}: expected {count} Gaussians, got shape {shape}")
