"""What measures and losses ask of their tensors: equal shapes, and float32 or better.

Half precision has three digits: sums over pixels and differences of products drown in it, so
everything is widened first, and automatic mixed precision is switched off where it would narrow
again.
"""

from contextlib import AbstractContextManager, nullcontext

import torch
from torch import Tensor

from diff4splat.errors import ShapeError


def promote(*tensors: Tensor) -> tuple[Tensor, ...]:
    """All in their common dtype, but at least float32."""
    dtype = torch.float32
    for tensor in tensors:
        dtype = torch.promote_types(dtype, tensor.dtype)
    return tuple(tensor.to(dtype) for tensor in tensors)


def no_autocast(like: Tensor) -> AbstractContextManager[None]:
    """A region in which matrix products and convolutions stay in the dtype of their inputs."""
    kind = like.device.type
    # Some devices know no automatic mixed precision, and refuse to have it switched off.
    known = torch.amp.is_autocast_available(kind)
    return torch.autocast(kind, enabled=False) if known else nullcontext()


def require_alike(what: str, got: Tensor, like: Tensor) -> None:
    """Refuse to broadcast.

    Raises:
        ShapeError: the shapes differ.
    """
    if got.shape != like.shape:
        raise ShapeError(f"{what}: expected {tuple(like.shape)}, got {tuple(got.shape)}")


def require_mask(valid: Tensor, shape: tuple[int, ...]) -> None:
    """Refuse a mask that does not belong to its map.

    Raises:
        ShapeError: another shape, or not boolean.
    """
    if tuple(valid.shape) != tuple(shape) or valid.dtype != torch.bool:
        got = f"{tuple(valid.shape)} {str(valid.dtype).removeprefix('torch.')}"
        raise ShapeError(f"valid: expected {tuple(shape)} bool, got {got}")
