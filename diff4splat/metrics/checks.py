"""Checks of metric and loss inputs: equal shapes, and at least float32.

Half precision has three digits, too few for sums over pixels and differences of products. Inputs
are promoted first, and automatic mixed precision is disabled where it would convert them back.
"""

from contextlib import AbstractContextManager, nullcontext

import torch
from torch import Tensor

from diff4splat.errors import ShapeError


def promote(*tensors: Tensor) -> tuple[Tensor, ...]:
    """Promote tensors to their common dtype, at least float32."""
    dtype = torch.float32
    for tensor in tensors:
        dtype = torch.promote_types(dtype, tensor.dtype)
    return tuple(tensor.to(dtype) for tensor in tensors)


def no_autocast(like: Tensor) -> AbstractContextManager[None]:
    """Context in which matrix products and convolutions keep the dtype of their inputs."""
    kind = like.device.type
    # Some devices have no automatic mixed precision, and raise an error when it is disabled.
    is_available = torch.amp.is_autocast_available(kind)
    return torch.autocast(kind, enabled=False) if is_available else nullcontext()


def require_alike(what: str, got: Tensor, like: Tensor) -> None:
    """Require equal shapes, without broadcasting.

    Raises:
        ShapeError: the shapes differ.
    """
    if got.shape != like.shape:
        raise ShapeError(f"{what}: expected {tuple(like.shape)}, got {tuple(got.shape)}")


def require_mask(valid: Tensor, shape: tuple[int, ...]) -> None:
    """Require a boolean mask of the expected shape.

    Raises:
        ShapeError: another shape, or not boolean.
    """
    if tuple(valid.shape) != tuple(shape) or valid.dtype != torch.bool:
        got = f"{tuple(valid.shape)} {str(valid.dtype).removeprefix('torch.')}"
        raise ShapeError(f"valid: expected {tuple(shape)} bool, got {got}")
