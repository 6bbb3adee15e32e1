"""Initial weights that are drawn one at a time, for networks that no process holds as a whole.

A network is made on the meta device while every call that gives a weight its value is recorded. The
calls are repeated in the same order from the same random stream, one weight after another: values
equal those of ``create_networks`` to the bit, and memory holds the weight that is being drawn.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode

from diff4splat.errors import ConfigError

CONSTANTS = (torch.zeros, torch.ones, torch.full, torch.tensor)
"""Functions that make a weight with its values."""
FILLS = ("zero_", "fill_", "uniform_", "normal_", "erfinv_", "mul_", "add_", "clamp_")
"""Methods that change the values of a weight, also inside ``torch.nn.init``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """One call that changes the values of ``target``."""

    function: Callable[..., Any]
    target: Tensor
    arguments: tuple[Any, ...]
    options: Mapping[str, Any]
    creates: bool

    @property
    def key(self) -> int:
        """The memory that the values are for: parameters are other objects than their tensors."""
        return memory_key(self.target)


class RecordedCalls(TorchFunctionMode):
    """Records how the weights of networks on the meta device get their values."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[Call] = []

    def __torch_function__(
        self,
        func: Callable[..., Any],
        types: Sequence[type],
        args: tuple[Any, ...] = (),
        kwargs: dict[str, Any] | None = None,
    ) -> Any:
        """Values are not drawn yet: on the meta device that would load a compiler."""
        del types
        kwargs = kwargs or {}
        if func in CONSTANTS:
            made = func(*args, **kwargs)
            self._record(func, made, args, kwargs, creates=True)
            return made
        initial = getattr(func, "__module__", None) == "torch.nn.init"
        if not initial and getattr(func, "__name__", "") not in FILLS:
            return func(*args, **kwargs)
        rest = dict(kwargs)
        target = args[0] if args else rest.pop("tensor")
        self._record(func, target, args[1:], rest, creates=False)
        return target

    def _record(
        self, func: Callable[..., Any], target: Tensor, args: tuple, kwargs: dict, *, creates: bool
    ) -> None:
        call = Call(function=func, target=target, arguments=args, options=kwargs, creates=creates)
        self.calls.append(call)


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialWeights:
    """How to draw the weights of one network."""

    calls: Sequence[Call]
    seed: int
    names: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    """Names of the weights and buffers by memory; several where they share it."""

    def draw(self) -> Iterator[tuple[str, Tensor]]:
        """Name and values of every weight on the CPU; each is let go when the next is asked for.

        The caller's random state is as before at every ``yield``.
        """
        last = {call.key: place for place, call in enumerate(self.calls)}
        open_values: dict[int, Tensor] = {}
        state = torch.Generator().manual_seed(self.seed).get_state()
        for place, call in enumerate(self.calls):
            if call.key not in self.names:
                continue
            with torch.random.fork_rng(devices=[]), torch.no_grad(), torch.device("cpu"):
                torch.set_rng_state(state)
                open_values[call.key] = _repeated(call, open_values.get(call.key))
                state = torch.get_rng_state()
            if last[call.key] == place:
                value = open_values.pop(call.key)
                for name in self.names[call.key]:
                    yield name, value
                del value


def initial_weights(network: nn.Module, calls: Sequence[Call], seed: int) -> InitialWeights:
    """The recorded calls with the names that the network has.

    Raises:
        ConfigError: a weight gets its value in a way that was not recorded.
    """
    names: dict[int, tuple[str, ...]] = {}
    for name, value in network.state_dict(keep_vars=True).items():
        names[memory_key(value)] = (*names.get(memory_key(value), ()), name)
    known = {call.key for call in calls}
    missing = [name for key, found in names.items() if key not in known for name in found]
    if missing:
        raise ConfigError(
            f"sharded weights: expected initial values by torch.nn.init, got others for "
            f"{', '.join(missing[:3])}; train with trainer.parallel=ddp"
        )
    return InitialWeights(calls=calls, seed=seed, names=names)


def memory_key(tensor: Tensor) -> int:
    """Equal for a tensor and a parameter made of it."""
    return tensor.untyped_storage()._cdata


def _repeated(call: Call, value: Tensor | None) -> Tensor:
    if call.creates:
        return call.function(*call.arguments, **call.options)
    target = call.target
    if value is None:
        value = torch.empty(target.shape, dtype=target.dtype)
    # The call may be for a part of the weight.
    part = value.as_strided(target.shape, target.stride(), target.storage_offset())
    call.function(part, *call.arguments, **call.options)
    return value
