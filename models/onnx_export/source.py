"""What is exported: a module whose inputs and outputs are tensors, and examples of its inputs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from diff4splat.models.onnx.manifest import TensorSpec
from diff4splat.models.onnx.shapes import Axis, LinearSize, parse_axis, shape_of

Example = Callable[[tuple[int, ...], torch.Generator], Tensor]
"""Values of an input of that shape."""
TRACED_SIZES: Mapping[str, int] = {"batch": 2, "packs": 2, "frames": 3, "tokens": 7}
"""Sizes that differ from each other, so that none is taken for another; others count up from 4."""
FIRST_OTHER_SIZE = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class InputSource:
    """An input with a function for example values."""

    spec: TensorSpec
    example: Example


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphSource:
    """A graph to be: ``module`` takes the inputs in order and returns the outputs as a tuple."""

    name: str
    part: str
    module: nn.Module
    inputs: tuple[InputSource, ...]
    outputs: tuple[TensorSpec, ...]
    sizes: tuple[tuple[str, int], ...] = ()
    """Of names whose usual sizes would take long."""

    @property
    def size_names(self) -> list[str]:
        """Names of the sizes of its inputs, in order of appearance."""
        axes = [parse_axis(axis) for source in self.inputs for axis in source.spec.shape]
        return list(dict.fromkeys(axis.name for axis in axes if isinstance(axis, LinearSize)))

    def traced_sizes(self) -> dict[str, int]:
        """The sizes that the graph is traced with."""
        sizes = {**TRACED_SIZES, **dict(self.sizes)}
        for name in self.size_names:
            sizes.setdefault(name, FIRST_OTHER_SIZE + len(sizes) - len(TRACED_SIZES))
        return {name: sizes[name] for name in self.size_names}

    def examples(self, sizes: Mapping[str, int], seed: int = 0) -> tuple[Tensor, ...]:
        """One value for every input."""
        generator = torch.Generator().manual_seed(seed)
        return tuple(
            source.example(shape_of(source.spec.shape, sizes), generator) for source in self.inputs
        )


class TensorFunction(nn.Module):
    """A method of a network as a module of its own, for the exporter."""

    def __init__(self, network: nn.Module, function: Callable[..., tuple[Tensor, ...]]) -> None:
        super().__init__()
        self.network, self.function = network, function

    def forward(self, *tensors: Tensor) -> tuple[Tensor, ...]:
        """The function of the network and the inputs."""
        return self.function(self.network, *tensors)


def output(name: str, *shape: Axis) -> TensorSpec:
    """A float32 output."""
    return TensorSpec(name=name, dtype="float32", shape=shape)


def normal(name: str, *shape: Axis) -> InputSource:
    """Standard normal numbers."""
    return _float(name, shape, lambda size, generator: torch.randn(size, generator=generator))


def unit(name: str, *shape: Axis) -> InputSource:
    """Evenly distributed in [0, 1)."""
    return _float(name, shape, lambda size, generator: torch.rand(size, generator=generator))


def pixels(name: str, *shape: Axis) -> InputSource:
    """In [32, 64), such as focal lengths."""
    return _float(
        name, shape, lambda size, generator: 32 * (1 + torch.rand(size, generator=generator))
    )


def poses(name: str, *shape: Axis) -> InputSource:
    """Cameras side by side, without a turn."""

    def example(size: tuple[int, ...], generator: torch.Generator) -> Tensor:
        pose = torch.eye(4).expand(size).clone()
        pose[..., :3, 3] = 0.1 * torch.randn(*size[:-2], 3, generator=generator)
        return pose

    return _float(name, shape, example)


def integers(name: str, below: int, *shape: Axis) -> InputSource:
    """From 0 to ``below`` − 1."""
    return InputSource(
        spec=TensorSpec(name=name, dtype="int64", shape=shape),
        example=lambda size, generator: torch.randint(below, size, generator=generator),
    )


def mask(name: str, *shape: Axis) -> InputSource:
    """All true but the last ones of the first sample."""

    def example(size: tuple[int, ...], generator: torch.Generator) -> Tensor:
        values = torch.ones(size, dtype=torch.bool)
        values[0, size[1] // 2 + 1 :] = False
        return values

    return InputSource(spec=TensorSpec(name=name, dtype="bool", shape=shape), example=example)


def _float(name: str, shape: tuple[Axis, ...], example: Example) -> InputSource:
    return InputSource(spec=TensorSpec(name=name, dtype="float32", shape=shape), example=example)
