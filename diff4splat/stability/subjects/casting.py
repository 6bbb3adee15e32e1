"""Networks in another precision, with the calls of the original."""

import copy
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any

import torch
from torch import Tensor, nn

from diff4splat.geometry.camera import Camera
from diff4splat.models.networks import Networks

DTYPES = {"float32": torch.float32, "bfloat16": torch.bfloat16, "float16": torch.float16}
"""The precisions that are compared with float64."""


def camera_dtype(dtype: torch.dtype) -> torch.dtype:
    """Cameras never follow the networks into half precision."""
    return torch.promote_types(dtype, torch.float32)


def cast(value: Any, dtype: torch.dtype) -> Any:
    """``value`` with every floating-point tensor in it cast; containers and dataclasses too."""
    if isinstance(value, Camera):
        return value.to(camera_dtype(dtype))
    if isinstance(value, Tensor):
        return value.to(dtype) if value.is_floating_point() else value
    if isinstance(value, tuple | list):
        return type(value)(cast(part, dtype) for part in value)
    if is_dataclass(value) and not isinstance(value, type):
        parts = {field.name: cast(getattr(value, field.name), dtype) for field in fields(value)}
        return replace(value, **parts)
    if isinstance(value, Iterator):
        return (cast(part, dtype) for part in value)
    return value


class CastNetwork:
    """Computes in ``dtype``; takes and returns float32."""

    def __init__(self, network: nn.Module, dtype: torch.dtype) -> None:
        self._network = copy.deepcopy(network).to(dtype).eval()
        self._dtype = dtype

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """As the network."""
        return self._converted(self._network)(*arguments, **named)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._network, name)
        return self._converted(value) if callable(value) else value

    def to(self, target: Any) -> "CastNetwork":
        """Unchanged: it stays on the CPU in its own precision."""
        del target
        return self

    def _converted(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def converted(*arguments: Any, **named: Any) -> Any:
            given = {name: cast(value, self._dtype) for name, value in named.items()}
            return cast(call(*cast(arguments, self._dtype), **given), torch.float32)

        return converted


def cast_networks(networks: Networks, dtype: torch.dtype) -> Networks:
    """Copies of all loaded networks in ``dtype``."""
    copies = {name: CastNetwork(network, dtype) for name, network in networks.parts()}
    return replace(networks, **copies)
