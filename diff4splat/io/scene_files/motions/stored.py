"""A motion in the terms of a file, and what turns one kind into it and back."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.io.scene_files.tensor_checks import take_numbers
from diff4splat.scene.motion.protocol import Motion


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredMotion:
    """A motion in the terms of a file."""

    settings: Mapping[str, Any]
    """JSON values; ``kind`` names the codec and ``time_range_s`` is always there."""
    tensors: Mapping[str, Tensor] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionCodec:
    """How one kind of motion is written and read."""

    motion_type: type
    pack: Callable[[Any], StoredMotion]
    """Takes a motion of that type."""
    unpack: Callable[[StoredMotion, int], Motion]
    """Takes the number of Gaussians; raises FileFormatError or ShapeError."""


def take_time_range(settings: Mapping[str, Any]) -> tuple[float, float]:
    """First and last second of a motion.

    Raises:
        FileFormatError: missing, not two finite numbers, or in the wrong order.
    """
    first, last = take_numbers(settings, "time_range_s", 2)
    if first > last:
        raise FileFormatError(
            f"metadata 'time_range_s': expected first ≤ last, got {first}, {last}"
        )
    return float(first), float(last)


def require_one_dtype(tensors: Mapping[str, Tensor | None]) -> None:
    """Require equal dtypes of all tensors that are there.

    Raises:
        FileFormatError: the dtypes differ.
    """
    kinds = {str(tensor.dtype)[6:] for tensor in tensors.values() if tensor is not None}
    if len(kinds) != 1:
        raise FileFormatError(
            f"motion: expected the dtype of means, got {', '.join(sorted(kinds))}"
        )
