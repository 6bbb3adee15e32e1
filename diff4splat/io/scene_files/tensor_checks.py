"""Tensors and JSON values taken out of a file by name, each checked before anything uses it."""

from collections.abc import Mapping
from types import UnionType
from typing import Any

import torch
from torch import Tensor

from diff4splat.errors import FileFormatError

_KIND_NAMES: dict[type | UnionType, str] = {
    dict: "an object",
    list: "a list",
    str: "text",
    bool: "true or false",
    float | int: "a number",
    str | None: "text or null",
    int | None: "a whole number or null",
}


def take_floats(tensors: Mapping[str, Tensor], name: str, shape: tuple[int | None, ...]) -> Tensor:
    """The finite float32 or float64 tensor called ``name``; None in ``shape`` is any size.

    Raises:
        FileFormatError: it is missing, of another shape or type, or holds NaN or infinity.
    """
    value = _take(tensors, name, shape, (torch.float32, torch.float64))
    broken = int((~torch.isfinite(value)).sum())
    if broken:
        raise FileFormatError(
            f"{name}: expected finite numbers, got {broken} of {value.numel()} NaN or infinite"
        )
    return value


def take_index(tensors: Mapping[str, Tensor], name: str, count: int) -> Tensor:
    """The int64 tensor called ``name``: positions among ``count``, increasing.

    Raises:
        FileFormatError: it is missing, of another shape or type, out of range or out of order.
    """
    value = _take(tensors, name, (None,), (torch.int64,))
    if len(value) and (int(value.min()) < 0 or int(value.max()) >= count):
        worst = int(value.min()) if int(value.min()) < 0 else int(value.max())
        raise FileFormatError(f"{name}: expected indices from 0 to {count - 1}, got {worst}")
    if bool((value.diff() <= 0).any()):
        raise FileFormatError(f"{name}: expected increasing indices, got some out of order")
    return value


def take_flags(
    tensors: Mapping[str, Tensor], name: str, shape: tuple[int | None, ...], dtype: torch.dtype
) -> Tensor:
    """The truth values that a tensor of 0 and 1 stores in ``dtype``.

    Raises:
        FileFormatError: it is missing, of another shape or type, or holds other numbers.
    """
    value = _take(tensors, name, shape, (dtype,))
    if bool(((value != 0) & (value != 1)).any()):
        raise FileFormatError(f"{name}: expected 0 and 1, got other numbers")
    return value.bool()


def _take(
    tensors: Mapping[str, Tensor],
    name: str,
    shape: tuple[int | None, ...],
    dtypes: tuple[torch.dtype, ...],
) -> Tensor:
    if name not in tensors:
        raise FileFormatError(f"{name}: expected this tensor, got a file without it")
    value = tensors[name]
    if value.dtype not in dtypes:
        want = " or ".join(str(dtype).removeprefix("torch.") for dtype in dtypes)
        raise FileFormatError(f"{name}: expected {want}, got {str(value.dtype)[6:]}")
    sizes = zip(shape, value.shape, strict=False)
    if len(shape) != value.ndim or any(want not in (None, got) for want, got in sizes):
        wanted = ", ".join("any" if size is None else str(size) for size in shape)
        raise FileFormatError(f"{name}: expected shape ({wanted}), got {tuple(value.shape)}")
    return value


def take_value(
    source: Mapping[str, Any], key: str, kind: type | UnionType, default: Any = ...
) -> Any:
    """The JSON value under ``key``, of type ``kind``; a default of ``...`` means it must be there.

    Raises:
        FileFormatError: it is missing or of another type.
    """
    if key not in source and default is not ...:
        return default
    value = source.get(key, ...)
    # bool is an int to Python, but true is not a number to anybody else.
    wrong = not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool)
    if wrong:
        got = "nothing" if value is ... else repr(value)[:60]
        raise FileFormatError(f"metadata '{key}': expected {_KIND_NAMES[kind]}, got {got}")
    return value


def take_numbers(
    source: Mapping[str, Any], key: str, count: int, integer: bool = False
) -> list[Any]:
    """The JSON list of ``count`` finite numbers under ``key``, whole ones on demand.

    Raises:
        FileFormatError: it is missing, of another length, or holds something else.
    """
    values = take_value(source, key, list)
    kinds = int if integer else int | float
    # A comparison, not isfinite: JSON allows whole numbers that no float can hold.
    fine = [isinstance(v, kinds) and not isinstance(v, bool) and abs(v) < 1e300 for v in values]
    if len(values) != count or not all(fine):
        wanted = f"{count} {'whole ' if integer else ''}numbers"
        raise FileFormatError(f"metadata '{key}': expected {wanted}, got {repr(values)[:60]}")
    return values
