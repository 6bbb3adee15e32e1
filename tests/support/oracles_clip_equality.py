"""Are two clips the same, bit for bit, and which field differs first?"""

from dataclasses import fields, is_dataclass

import torch


def first_difference(one: object, other: object, where: str = "clip") -> str | None:
    """The path of the first field that differs; None when all are equal, types included."""
    if type(one) is not type(other):
        return where
    if isinstance(one, torch.Tensor):
        same = one.dtype == other.dtype and torch.equal(one, other)
        return None if same else where
    if is_dataclass(one):
        pairs = [(f.name, getattr(one, f.name), getattr(other, f.name)) for f in fields(one)]
    elif isinstance(one, tuple):
        if len(one) != len(other):
            return where
        pairs = [(str(n), a, b) for n, (a, b) in enumerate(zip(one, other, strict=True))]
    else:
        return None if one == other else where
    for name, a, b in pairs:
        found = first_difference(a, b, f"{where}.{name}")
        if found:
            return found
    return None
